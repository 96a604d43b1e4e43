"""Which controllers run: one for each joint, started and stopped by controller_manager's requests."""

from __future__ import annotations

from pathlib import Path

import pytest

from messages.controllers import SwitchController
from messages.std import Empty
from services.controller_manager.config_file import parse_config
from services.controller_manager.controller import CommandLimiter, JointReading, Ports
from services.controller_manager.manager import ControllerManager
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.parameters.base import Parameters
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node
from tests.services.controller_manager.arm_stand import CONTROLLERS

HERE = {joint: JointReading(0.1, 0.0) for joint in ("waist", "shoulder", "elbow", "gripper")}
ALL = ["arm_controller", "gripper_controller", "group_controller", "effort_controller", "waist_controller"]


def manager(*chosen: str, text: str = CONTROLLERS) -> tuple[ControllerManager, list[str]]:
    """Return a manager of the test controllers, and its list of warnings."""
    warnings: list[str] = []
    ctx = Context(memory_node(MemoryBus(), "manager", "/arm"), Parameters(), 100)
    ports = Ports(
        stream=ctx.stream,
        advertise=ctx.advertise,
        announce=lambda name, params: lambda: params,
        limiter=CommandLimiter(warnings.append),
        warn=warnings.append,
        command_timeout=lambda: 0.0,
    )
    return ControllerManager(parse_config(Path("c.yaml"), text, "/arm"), chosen, ports), warnings


def switched(each: ControllerManager, start: tuple[str, ...] = (), stop: tuple[str, ...] = (), strict: int = 2) -> None:
    each.switch_controller(SwitchController(start_controllers=start, stop_controllers=stop, strictness=strict))


def targets(each: ControllerManager) -> dict[str, str]:
    """Return the commanded joints with their command interfaces."""
    each.start(HERE, 0)
    return {target.joint_name: target.interface for target in each.update(HERE, 0, 0.01)}


def test_a_joint_has_the_first_controller_of_the_file_or_those_that_are_named() -> None:
    every, warnings = manager()
    assert every.running == ("arm_controller", "gripper_controller")
    assert warnings == [
        "not started, as others have their joints: group_controller (arm_controller has shoulder), "
        "effort_controller (arm_controller has shoulder), waist_controller (arm_controller has waist)"
    ]
    some, warnings = manager("waist_controller", "group_controller")
    assert some.running == ("group_controller", "waist_controller")
    assert warnings == []
    assert targets(some) == {"shoulder": "position", "elbow": "position", "waist": "velocity"}
    with pytest.raises(BadInput, match="group_controller and arm_controller both claim the joint shoulder"):
        manager("arm_controller", "group_controller")
    with pytest.raises(BadInput, match=r"unknown controller 'arm'"):
        manager("arm")


def test_controllers_are_switched_all_or_none() -> None:
    each, _ = manager()
    assert targets(each).keys() == {"waist", "shoulder", "elbow", "gripper"}
    for start, stop, told in (
        (("group_controller",), (), "both claim the joint shoulder: stop one of them"),
        (("group_controler",), ("arm_controller",), "unknown controller 'group_controler'; did you mean 'group_contr"),
    ):
        with pytest.raises(BadInput, match=told):
            switched(each, start, stop)
        assert each.running == ("arm_controller", "gripper_controller")
    switched(each, ("group_controller", "waist_controller"), ("arm_controller",))
    assert targets(each) == {"gripper": "effort", "shoulder": "position", "elbow": "position", "waist": "velocity"}
    listed = each.list_controllers(Empty()).controller
    assert [one.name for one in listed] == ALL
    assert [one.state for one in listed] == ["stopped", "running", "running", "initialized", "running"]
    assert listed[2].claimed_interfaces == ("shoulder/position", "elbow/position")
    assert listed[0].claimed_interfaces == ()


def test_a_controller_that_is_named_twice_is_started_once() -> None:
    each, warnings = manager("gripper_controller")
    switched(each, ("waist_controller", "waist_controller"))
    assert each.running == ("gripper_controller", "waist_controller")
    assert warnings == []


@pytest.mark.parametrize("strictness", [0, 1])
def test_best_effort_leaves_out_what_cannot_be_done(strictness: int) -> None:
    """A request of ROS 1 that does not set its strictness has 0."""
    each, warnings = manager()
    switched(each, ("effort_controller", "nobody", "waist_controller"), ("gripper_controller",), strict=strictness)
    assert each.running == ("arm_controller",)
    assert warnings[-1].endswith("waist_controller (arm_controller has waist)")


def test_two_controllers_of_one_name_are_refused() -> None:
    text = "a/c: {type: position_controllers/JointPositionController, joint: elbow}\n"
    with pytest.raises(BadInput, match=r"c\.yaml:2: there are two controllers 'c'"):
        manager(text=text + text.replace("a/c", "/a/c"))
