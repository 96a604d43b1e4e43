"""Launch files and nodes that a script starts with the module roslaunch."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports
from tests.harness.waiting import wait_until

COMMAND = """#!/bin/sh
trap 'echo ended >> "$TOLD"; exit 0' INT
echo "$(basename "$0") $ROS_NAMESPACE $*" >> "$TOLD"
echo "parent $ELEA_PARENT_PID" >> "$TOLD"
while :; do sleep 0.02; done
"""


@pytest.fixture(autouse=True)
def kernel() -> Iterator[ScriptKernel]:
    with ros1_imports() as made:
        yield made


@pytest.fixture
def told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder where fakes of our commands record their arguments."""
    for name in ("roslaunch", "rosrun"):
        (tmp_path / name).write_text(COMMAND)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    monkeypatch.setenv("TOLD", str(tmp_path / "told"))
    monkeypatch.delenv("ROS_NAMESPACE", raising=False)
    return tmp_path / "told"


def has(file: Path, text: str) -> bool:
    return file.exists() and text in file.read_text()


@pytest.mark.process
def test_a_launch_file_runs_until_it_is_shut_down(told: Path) -> None:
    import roslaunch

    file = told.with_name("a.launch")
    file.write_text("<launch/>")
    uuid = roslaunch.rlutil.get_or_generate_uuid(None, False)
    roslaunch.configure_logging(uuid)
    files = [(roslaunch.rlutil.resolve_launch_arguments([str(file)])[0], ["speed:=2"])]
    launch = roslaunch.parent.ROSLaunchParent(uuid, files)
    launch.start()
    wait_until(lambda: has(told, f"roslaunch  {file} speed:=2"), 20, "the launch file")
    assert launch.spin_once()
    launch.shutdown()
    assert has(told, "ended")
    assert not launch.spin_once()
    launch.shutdown()  # a second time does nothing
    with pytest.raises(roslaunch.RLException, match="not a launch file name"):
        roslaunch.parent.ROSLaunchParent(uuid, ["/nowhere.launch"]).start()


@pytest.mark.process
def test_a_node_is_started_and_stopped(told: Path) -> None:
    import roslaunch

    launch = roslaunch.scriptapi.ROSLaunch()
    launch.start()
    node = roslaunch.core.Node(
        "pkg", "talker.py", name="loud", namespace="/a", args="'two words' 3", remap_args=[("chatter", "news")]
    )
    process = launch.launch(node)
    wait_until(lambda: has(told, "rosrun /a pkg talker.py two words 3 chatter:=news __name:=loud"), 20, "the node")
    wait_until(lambda: has(told, f"parent {os.getpid()}\n"), 20, "whom it must not outlive")
    assert process.is_alive()
    assert process.exit_code is None
    process.stop()
    assert (process.is_alive(), process.exit_code) == (False, 0)
    launch.stop()


def test_what_is_not_there_says_what_to_use() -> None:
    import roslaunch

    with pytest.raises(AttributeError, match=r"roslaunch\.xmlloader is not part of Elea: .*ROSLaunchParent"):
        _ = roslaunch.xmlloader
    with pytest.raises(roslaunch.RLException, match="neither a launch file"):
        roslaunch.rlutil.resolve_launch_arguments(["no_such_package", "a.launch"])
