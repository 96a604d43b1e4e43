"""dynamic_reconfigure's server and client behave as ROS's own, on an in-memory kernel."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from services.script.reconfigure_config import config_module
from tests.harness.ros1 import ros1_imports
from tests.harness.waiting import wait_until
from tests.services.script.test_reconfigure_config import ARM, write

WITHIN_S = 60.0


def test_a_server_and_its_clients(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clamped values, levels, enums by name, the latched first configuration on a thread of its own, groups."""
    module = SimpleNamespace(**config_module(write(tmp_path, ARM)))
    with ros1_imports():
        import dynamic_reconfigure.client  # type: ignore[import-not-found]
        import rospy  # type: ignore[import-not-found]
        from dynamic_reconfigure import (  # type: ignore[import-not-found]
            DynamicReconfigureCallbackException,
            DynamicReconfigureParameterException,
        )
        from dynamic_reconfigure.client import Client  # type: ignore[import-not-found]
        from dynamic_reconfigure.server import Server  # type: ignore[import-not-found]

        rospy.init_node("arm")
        rospy.set_param("~gain", 7)
        rospy.set_param("~title", 3)
        levels: list[int] = []

        def callback(config: Any, level: int) -> Any:
            levels.append(level)
            if config.title == "fail":
                return None
            config["count"] = min(config.count, 60)
            return config

        server = Server(module, callback)
        assert levels == [~0]
        assert server.config.gain == 1.0, "launched with 7, clamped"
        assert server.config["title"] == "Hello World", "a number is not a text"
        assert rospy.get_param("~") == {
            "gain": 1.0,
            "title": "Hello World",
            "count": 50,
            "free": 3.0,
            "on": True,
            "size": 1,
            "inner": 2,
            "deep": 2.0,
        }
        assert server.config.groups.groups.My_group.state is False
        assert server.config.groups.groups.My_group.groups["sub"].parameters == {"deep": 2.0}

        told: list[tuple[str, Any]] = []
        pauses, gone_on = list[float](), threading.Event()

        def pause(seconds: float) -> None:
            pauses.append(seconds)
            assert gone_on.wait(WITHIN_S)

        monkeypatch.setattr(dynamic_reconfigure.client, "time", SimpleNamespace(sleep=pause))
        client = Client("arm", timeout=WITHIN_S, config_callback=lambda config: told.append((_thread(), config)))
        wait_until(lambda: len(pauses) == 1)
        assert told == [], "the script goes on before"
        gone_on.set()
        assert client.get_configuration(timeout=WITHIN_S)["count"] == 50
        wait_until(lambda: len(told) == 1)
        assert told[0][0] != _thread()
        assert "{size} {gain}".format(**told[0][1]) == "1 1.0"
        assert told[0][1]["groups"]["groups"]["My_group"]["inner"] == 2
        assert [each["name"] for each in client.get_parameter_descriptions(timeout=WITHIN_S)] == list(module.defaults)
        assert client.get_group_descriptions()["groups"]["My_group"]["type"] == "collapse"

        made = client.update_configuration({"count": 500, "on": "no", "size": "small", "gain": "0.25"})
        assert (made["count"], made["on"], made["size"], made["gain"]) == (60, False, 0, 0.25)
        assert levels[-1] == 1 | 4
        wait_until(lambda: len(told) == 2)
        assert told[1][1]["count"] == rospy.get_param("~count") == 60
        for wrong, error in (
            ({"nope": 1}, "don't know parameter: nope"),
            ({"count": "x"}, "can't set parameter 'count' of <class 'int'>"),
        ):
            with pytest.raises(DynamicReconfigureParameterException, match=error):
                client.update_configuration(wrong)
        with pytest.raises(DynamicReconfigureCallbackException, match="service call failed"):
            client.update_configuration({"title": "fail"})
        assert server.update_configuration({"inner": 5})["inner"] == 5
        client.close()
        client.config_callback = lambda config: told.append(("set", config))
        assert told[-1][0] == "set"


def test_a_client_without_a_server_gives_up() -> None:
    with ros1_imports():
        import rospy
        from dynamic_reconfigure.client import Client

        rospy.init_node("alone")
        with pytest.raises(rospy.ROSException, match="timeout exceeded"):
            Client("/nobody", timeout=0.05)


def _thread() -> str:
    return threading.current_thread().name
