"""A dynamic_reconfigure server's parameters as a set of Elea, against the parameter service's implementation."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from messages.base import decoder, encode
from messages.parameters import ParameterSet, ParameterValues, SetParameters, UndoParameters
from messages.requests import PARAMS_ANNOUNCE, PARAMS_SET
from messages.rosparam import RosparamTree
from services.runtime.errors import BadInput
from services.script.api import Input, Origin, ServiceRefused
from services.script.reconfigure_config import config_module
from services.script.reconfigure_set import ReconfigureSet
from tests.services.params.parameter_client import assignments, value_dict
from tests.services.params.server_harness import ServerHarness, server_harness

NODE, SET = "/arm", "/arm/config"
CFG = """
from dynamic_reconfigure.parameter_generator_catkin import *
gen = ParameterGenerator()
kinds = gen.enum([gen.const("step", int_t, 0, "A step"), gen.const("sine", int_t, 1, "A sine")], "Kinds")
gen.add("kind", int_t, 1, "Kind of reference", 0, 0, 1, edit_method=kinds)
gen.add("gain", double_t, 2, "Gain", 8.0, 0.0, 50.0)
gen.add("count", int_t, 4, "Count", 3, 0, 10)
gen.add("on", bool_t, 8, "Switch", True)
gen.add("title", str_t, 16, "Text", "arm")
gen.add("free", double_t, 32, "Unbounded", 1.0)
exit(gen.generate("arm", "arm", "Arm"))
"""


class SetKernel:
    """The part of a kernel that a set uses, with the parameter service behind it."""

    def __init__(self, service: ServerHarness | None) -> None:
        self.service, self.logged = service, ""
        self._receivers: dict[str, Callable[[bytes, Origin], None]] = {}
        self._seen = 0

    def deliver(self) -> None:
        """Receive the published updates, as at a tick."""
        assert self.service is not None
        published = self.service.published[self._seen :]
        self._seen += len(published)
        for each in published:
            if isinstance(each, ParameterValues) and each.set == SET:
                self._receivers[f"{SET}/parameter_updates"](encode(each), Origin("/params", True))

    def see_service(self, revision: int) -> None:
        self._receivers["/rosparam/tree"](encode(RosparamTree(revision=revision)), Origin("/params", True))

    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None = None
    ) -> Input:
        self._receivers[name] = receive
        return None  # type: ignore[return-value]

    def call(self, name: str, ros_type: str, payload: bytes, timeout: float | None = None) -> bytes:
        assert self.service is not None
        handlers: dict[str, tuple[Any, Any]] = {
            PARAMS_ANNOUNCE.name: (PARAMS_ANNOUNCE, self.service.server.announce),
            PARAMS_SET.name: (PARAMS_SET, self.service.server.set),
        }
        request, handler = handlers[name]
        try:
            return encode(handler(decoder(request.request_type)(payload)))
        except BadInput as error:
            raise ServiceRefused(str(error)) from None

    def service_type(self, name: str) -> str | None:
        return None if self.service is None else "elea_msgs/Announcement"

    def lock(self) -> Any:
        return threading.RLock()

    def log(self, level: int, text: str, where: Mapping[str, Any]) -> None:
        self.logged += text


class Server:
    """A server whose callback limits the gain to 20."""

    def __init__(self, folder: Path, service: ServerHarness | None, **launched: Any) -> None:
        cfg = folder / "Arm.cfg"
        cfg.write_text(CFG)
        module = config_module(cfg)
        self.kernel, self.calls = SetKernel(service), 0
        self.set = ReconfigureSet(self.kernel, NODE, SET, module["config_description"], self.update)
        self.config: dict[str, Any] = module["defaults"] | launched
        self.config |= self.set.announce(launched)
        self.set.follow()

    def update(self, changes: Mapping[str, Any]) -> Mapping[str, Any]:
        self.calls += 1
        self.config |= changes
        self.config["gain"] = min(self.config["gain"], 20.0)
        return self.config


def test_the_set_describes_what_the_file_does(tmp_path: Path) -> None:
    with server_harness() as service:
        made = Server(tmp_path, service, gain=12.5)
        values = service.server.get(ParameterSet(set=SET))
        assert value_dict(values) == {
            "kind": "step",
            "gain": 12.5,
            "count": 3,
            "on": True,
            "title": "arm",
            "free": 1.0,
        }
        assert {each.name: each.origin for each in values.values}["gain"] == "fleet"
        assert made.config["kind"] == 0
        (schema,) = (each for each in service.published if hasattr(each, "parameters"))
        kind, gain, count, on, title, free = schema.parameters
        assert (kind.type, kind.choices, kind.default, kind.level) == ("str", ("step", "sine"), "step", 1)
        assert kind.choice_values == ("0", "1")
        assert "sine (1): A sine" in kind.text
        assert (gain.type, gain.low, gain.high, gain.default, gain.text) == ("float", 0.0, 50.0, 8.0, "Gain")
        assert (count.type, count.low, count.high) == ("int", 0, 10)
        assert (on.type, title.type, free.low, free.high) == ("bool", "str", None, None)


def test_what_people_set_reaches_the_script_and_what_its_callback_changes_counts(tmp_path: Path) -> None:
    with server_harness() as service:
        made = Server(tmp_path, service)
        made.kernel.deliver()
        assert made.calls == 0
        service.server.set(SetParameters(set=NODE, values=assignments(kind="sine", gain=40.0), who="me"))
        made.kernel.deliver()
        assert (made.config["kind"], made.config["gain"], made.calls) == (1, 20.0, 1)
        assert value_dict(service.server.get(ParameterSet(set=SET)))["gain"] == 20.0
        made.kernel.deliver()
        assert made.calls == 1, "its own change comes back"
        service.server.undo(UndoParameters(set=NODE))
        service.server.undo(UndoParameters(set=NODE))
        made.kernel.deliver()
        assert (made.config["kind"], made.config["gain"]) == (0, 8.0)
        with pytest.raises(BadInput, match=r"one of step \(0\), sine \(1\)"):
            service.server.set(SetParameters(set=NODE, values=assignments(kind="saw")))
        for number in (1, "1"):
            service.server.set(SetParameters(set=NODE, values=assignments(kind=number)))
            assert value_dict(service.server.get(ParameterSet(set=SET)))["kind"] == "sine"
            made.kernel.deliver()
            assert made.config["kind"] == 1
            service.server.undo(UndoParameters(set=NODE))
            made.kernel.deliver()
            assert made.config["kind"] == 0


def test_what_ros_sets_is_shown_for_the_run_and_not_saved(tmp_path: Path) -> None:
    with server_harness() as service:
        made = Server(tmp_path, service)
        for gain in (9.0, 10.0):
            made.config["gain"] = gain
            made.set.push(made.config)
        values = service.server.get(ParameterSet(set=SET))
        assert {each.name: (each.value, each.origin) for each in values.values}["gain"] == (10.0, "run")
        made.kernel.deliver()
        assert (made.config["gain"], made.calls) == (10.0, 0), "the first of the two did not come back"
        made.config["free"] = float("inf")
        made.set.push(made.config)
        assert not made.kernel.logged
        assert value_dict(service.server.get(ParameterSet(set=SET)))["free"] == 1.0


def test_a_change_beside_an_own_one_is_not_lost(tmp_path: Path) -> None:
    with server_harness() as service:
        made = Server(tmp_path, service)
        service.server.set(SetParameters(set=SET, values=assignments(count=7)))
        made.config["gain"] = 9.0
        made.set.push(made.config)
        made.kernel.deliver()
        assert (made.config["count"], made.config["gain"]) == (7, 9.0)
        assert value_dict(service.server.get(ParameterSet(set=SET)))["count"] == 7


def test_without_a_service_and_when_one_comes(tmp_path: Path) -> None:
    made = Server(tmp_path, None)
    made.config["gain"] = 9.0
    made.set.push(made.config)
    with server_harness() as service:
        made.kernel.service = service
        made.kernel.see_service(5)
        assert value_dict(service.server.get(ParameterSet(set=SET)))["gain"] == 9.0
    with server_harness() as again:
        made.kernel.service = again
        made.kernel.see_service(6)
        assert SET not in again.server.announced_sets
        made.kernel.see_service(1)
        assert value_dict(again.server.get(ParameterSet(set=SET)))["gain"] == 9.0
        assert {SET, NODE} <= again.server.announced_sets
