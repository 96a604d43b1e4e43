"""ROS 1 commands whose functions run on stand-ins for the network and the clock."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from services.script.loader import SITE_PACKAGES
from tests.harness.ros1 import ros1_imports

Load = Callable[[str], ModuleType]


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Iterator[Load]:
    """Return a function that imports a command."""
    known = set(sys.modules)
    with ros1_imports():
        monkeypatch.syspath_prepend(str(SITE_PACKAGES.parent / "command_line"))
        yield importlib.import_module
    for name in set(sys.modules) - known:
        if name.endswith("_command"):
            del sys.modules[name]


def test_the_bandwidth_of_a_topic_that_has_gone_silent_is_not_printed_again(
    load: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rostopic_command = load("rostopic_command")
    now, receive = [0.0], list[Callable[[Any], None]]()

    def pause(seconds: float) -> None:
        for _ in range(150 if now[0] < 1.0 else 0):
            now[0] += 0.01
            receive[0](SimpleNamespace(_buff=b"12345678"))
        now[0] += seconds

    stand_in = SimpleNamespace(
        init_node=lambda *_, **__: None,
        AnyMsg=object,
        Subscriber=lambda name, kind, callback: receive.append(callback),
        is_shutdown=lambda: now[0] > 4.0,
    )
    monkeypatch.setattr(rostopic_command, "rospy", stand_in)
    monkeypatch.setattr(rostopic_command, "time", SimpleNamespace(time=lambda: now[0], sleep=pause))
    rostopic_command.bw(["/chatter"])
    assert capsys.readouterr().out.splitlines() == [
        "subscribed to [/chatter]",
        "average: 800.00B/s",
        "\tmean: 8.00B min: 8.00B max: 8.00B window: 100",
        "no new messages",
        "no new messages",
    ]


def test_a_node_is_pinged_as_often_as_asked(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    rosnode_command = load("rosnode_command")
    pinged, pauses = list[str](), list[float]()
    monkeypatch.setattr(
        rosnode_command, "rosnode", SimpleNamespace(rosnode_ping=lambda name, verbose: pinged.append(name) or True)
    )
    monkeypatch.setattr(rosnode_command, "time", SimpleNamespace(sleep=pauses.append))
    rosnode_command.ping(["/talker", "-c", "3"])
    assert (pinged, pauses) == (["/talker"] * 3, [1.0] * 3)
    with pytest.raises(SystemExit) as ended:
        rosnode_command.ping(["-a"])
    assert ended.value.code == 2


def test_an_empty_argument_of_a_service_is_an_empty_text(load: Load, capsys: pytest.CaptureFixture[str]) -> None:
    rosservice_command = load("rosservice_command")
    import rospy
    from std_srvs.srv import Empty
    from turtlesim.srv import Spawn

    rospy.init_node("rosservice", anonymous=True)  # as the command does
    rospy.Service("/spawn", Spawn, lambda asked: asked.name or f"turtle2 at {asked.x:.0f}, {asked.y:.0f}")
    rospy.Service("/reset", Empty, lambda _: [])
    rosservice_command.call(["/spawn", "2", "3", "0.2", ""])
    rosservice_command.call(["/spawn", "[2, 3, 0.2, leo]"])
    rosservice_command.call(["/reset", ""])
    assert capsys.readouterr().out.split("\n") == ['name: "turtle2 at 2, 3"', 'name: "leo"', "", ""]
