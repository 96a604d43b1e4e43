"""Requests for joint efforts, as in Gazebo."""

from __future__ import annotations

import pytest

from messages.gazebo import ApplyEffort, JointName
from messages.requests import (
    APPLY_EFFORT,
    CLEAR_EFFORT,
    JOINT_PROPERTIES,
    RESET_WORLD,
)
from messages.std import Empty
from tests.services.sim.joints.joint_simulation import effort_request, robot_entry, run_joint_simulation


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (effort_request(5.0), "5 on arm::bear_link from now for 0.1 s"),
        (effort_request(5.0, joint="arm::bear_link"), "5 on arm::bear_link from now for 0.1 s"),
        (effort_request(-5.0, -1.0, "arm/bear_link"), "-5 on arm::bear_link from now until it is cleared"),
        (effort_request(5.0, 0.0, model="arm"), "from now for one physics step of 5 ms, the shortest there is"),
        (effort_request(5.0, 2.0, model="arm", start=3_000_000_000), "from 3 s for 2 s"),
    ],
)
def test_an_effort_is_applied_and_the_reply_says_how(asked: ApplyEffort, says: str) -> None:
    with run_joint_simulation() as on:
        assert says in on.call(APPLY_EFFORT, asked).text
        assert on.joint_properties().jobs == 1


def test_efforts_wait_act_and_are_cleared() -> None:
    with run_joint_simulation() as on:
        on.call(APPLY_EFFORT, effort_request(5.0, -1.0, start=50_000_000))
        on.run(0.05)
        assert (on.joint_properties().applied_effort, on.joint_properties().jobs) == (0.0, 1)
        on.run(0.01)
        assert on.joint_properties().applied_effort == 5.0
        assert on.call(CLEAR_EFFORT, JointName(joint_name="arm::bear_link")).text == "1 job of arm::bear_link cleared"
        on.run(0.005)
        assert (on.joint_properties().applied_effort, on.joint_properties().jobs) == (0.0, 0)
        on.call(APPLY_EFFORT, effort_request(5.0, -1.0))
        on.run(0.05)
        on.call(RESET_WORLD, Empty())
        assert on.joint_properties().jobs == 0


def test_what_a_joint_is_and_does() -> None:
    with run_joint_simulation(
        robot_entry("arm", "arm_corrected", joint_parameters={"damping": 2.0}), robot_entry("tb3", "burger", x=3.0)
    ) as on:
        on.publish_effort(400.0, 1.0)
        on.run(0.02)
        found = on.joint_properties()
        assert (found.model, found.type, found.damping, found.friction) == ("arm", "revolute", 2.0, 0.0)
        assert (found.lower, found.upper, found.effort_limit, found.velocity_limit) == (-1.5708, 1.5708, 200.0, 20.0)
        assert found.applied_effort == 200.0, "clamped"
        assert found.rate > 5.0
        wheel = on.call(JOINT_PROPERTIES, JointName(model="tb3", joint_name="wheel_left_joint"))
        assert (wheel.type, wheel.lower, wheel.jobs) == ("continuous", None, 0)
