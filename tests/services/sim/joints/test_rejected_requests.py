"""Rejected requests for joints, links and models, and the alternatives that the errors name."""

from __future__ import annotations

import math
from typing import Any

import pytest

from messages.base import Message
from messages.gazebo import ApplyWrench, LinkName, SetConfiguration
from messages.geometry import Point, Pose, Twist, Vector3, Wrench
from messages.parameters import Assignment
from messages.requests import (
    APPLY_EFFORT,
    APPLY_WRENCH,
    DELETE,
    GET_STATE,
    LINK_STATE,
    SET_CONFIGURATION,
    SET_STATE,
    SPAWN,
    Name,
    Request,
)
from messages.simulation import GetModelState, SetModelState, SpawnModel
from services.runtime.errors import CallFailed
from tests.services.sim.joints.joint_simulation import (
    JointSimulation,
    effort_request,
    robot_entry,
    run_joint_simulation,
)

REFUSED: list[tuple[Request[Any, Any], Message, str]] = [
    (APPLY_EFFORT, effort_request(1.0, joint="arm::elbow"), r"arm: unknown joint 'elbow' \(known: bear_link\)"),
    (
        APPLY_EFFORT,
        effort_request(1.0, joint="elbow"),
        "unknown joint 'elbow'.*known: .*arm::bear_link.*tb3::wheel_left_joint",
    ),
    (
        APPLY_EFFORT,
        effort_request(1.0, joint="bear_link"),
        "2 models have a joint 'bear_link': say which, arm::bear_link or",
    ),
    (APPLY_EFFORT, effort_request(1.0, model="arn"), "unknown model 'arn'; did you mean 'arm'"),
    (APPLY_EFFORT, effort_request(1.0, joint="arn::bear_link"), "unknown model 'arn'; did you mean 'arm'"),
    (
        APPLY_EFFORT,
        effort_request(1.0, joint="wheel_left_joint"),
        "is a wheel, which its base drives: command /tb3/cmd_vel",
    ),
    (APPLY_EFFORT, effort_request(1e9, model="arm"), "job.effort"),
    (SET_CONFIGURATION, SetConfiguration(model="arm", joint_names=("bear_link",)), "1 joint names and 0 positions"),
    (
        SET_CONFIGURATION,
        SetConfiguration(model="arm", joint_names=("bear_link",), joint_positions=(1.6,)),
        "bear_link = 1.6: its limits are -1.5708 and 1.5708",
    ),
    (
        SET_CONFIGURATION,
        SetConfiguration(model="arm", joint_names=("bear_link",) * 2, joint_positions=(0.1, 0.2)),
        "named twice",
    ),
    (
        SET_CONFIGURATION,
        SetConfiguration(model="tb3", joint_names=("wheel_left_joint",), joint_positions=(1.0,)),
        "which odometry counts",
    ),
    (APPLY_WRENCH, ApplyWrench(body_name="arm::elbow"), "arm: unknown link 'elbow'.*known: bear_link, end_link, root"),
    (APPLY_WRENCH, ApplyWrench(body_name="tb3", reference_frame="mars"), "unknown link 'mars'"),
    (
        APPLY_WRENCH,
        ApplyWrench(body_name="tb3", wrench=Wrench(force=Vector3(x=1e6))),
        "the limit is 100000 in each axis",
    ),
    (LINK_STATE, LinkName(link_name="tb3::base_scna"), "did you mean 'base_scan'"),
    (GET_STATE, GetModelState(name="tb3", relative_entity="arn"), "unknown link 'arn'"),
    (SET_STATE, SetModelState(name="tb3", reference_frame="two::x"), "two: unknown link 'x'"),
    (
        SET_STATE,
        SetModelState(name="arm", twist=Twist.planar(1.0, 0.0)),
        "arm has a fixed base: its pose can be set, but not its twist",
    ),
    (SPAWN, SpawnModel(name="new", model="burger", reference_frame="nowhere"), "unknown link 'nowhere'"),
    (
        SPAWN,
        SpawnModel(name="new", model="arm", pose=Pose.planar(-4, 0), joint_names=("elbow",), joint_positions=(1.0,)),
        "unknown joint 'elbow'",
    ),
    (
        SPAWN,
        SpawnModel(name="new", model="arm", parameters=(Assignment(name="dampin", value=1.0),)),
        "new: unknown parameter 'dampin'; did you mean 'damping'",
    ),
]


@pytest.fixture(scope="module")
def crowd() -> Any:
    """A simulation with two arms and a burger."""
    with run_joint_simulation(robot_entry("arm"), robot_entry("two", x=4.0), robot_entry("tb3", "burger", x=2.0)) as on:
        yield on


@pytest.mark.parametrize(("request_", "asked", "says"), REFUSED)
def test_what_is_refused_names_what_there_is(
    crowd: JointSimulation, request_: Request[Any, Any], asked: Message, says: str
) -> None:
    before = [robot.name for robot in crowd.simulation.robots]
    with pytest.raises(CallFailed, match=says):
        crowd.call(request_, asked)
    assert [robot.name for robot in crowd.simulation.robots] == before


def test_an_arm_is_not_swung_into_a_robot_and_a_robot_not_put_into_an_arm() -> None:
    """At 75 degrees the arm's head is at x = 0.74 m, z = 1.1 m; at 0 degrees it is out of the way."""
    high = Pose(position=Point(x=0.75, z=1.03))
    with run_joint_simulation() as on:
        on.call(SPAWN, SpawnModel(name="tb3", model="burger", pose=high))
        up = SetConfiguration(model="arm", joint_names=("bear_link",), joint_positions=(math.radians(75),))
        with pytest.raises(CallFailed, match=r"'arm' at .* would overlap with 'tb3'"):
            on.call(SET_CONFIGURATION, up)
        assert on.joint_properties().position == 0.0
        on.call(DELETE, Name(name="tb3"))
        on.call(SET_CONFIGURATION, up)
        with pytest.raises(CallFailed, match=r"'tb3' at .* would overlap with 'arm'"):
            on.call(SPAWN, SpawnModel(name="tb3", model="burger", pose=high))
