"""Wrenches on links: their axes, sum and end."""

from __future__ import annotations

import math

import pytest

from messages.gazebo import ApplyWrench, LinkName
from messages.geometry import Point, Pose, Quaternion, Vector3, Wrench
from messages.requests import (
    APPLY_WRENCH,
    CLEAR_WRENCH,
    DELETE,
    LINK_PROPERTIES,
    SPAWN,
    Name,
)
from messages.simulation import SpawnModel
from tests.services.sim.joints.joint_simulation import robot_entry, run_joint_simulation


def test_a_wrench_lifts_turns_and_ends() -> None:
    """In the air: 20 N on 1.0037 kg for 21 steps, then only gravity."""
    with run_joint_simulation(robot_entry("tb3", "burger")) as on:
        for link, share in (("base_footprint", 0.001), ("base_link", 0.999)):
            push = Wrench(force=Vector3(z=20.0 * share))
            on.call(
                APPLY_WRENCH,
                ApplyWrench(body_name=f"tb3::{link}", wrench=push, duration=0.1, reference_point=Point(x=-0.03)),
            )
        on.run(0.105)
        up = on.simulation.world.body("tb3").state().linear[2]
        assert up == pytest.approx((20.0 / 1.00373 - 9.81) * 0.105, rel=0.03)
        on.run(0.05)
        assert on.simulation.world.body("tb3").state().linear[2] == pytest.approx(up - 9.81 * 0.05, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("link", ["base_footprint", "base_link"])
@pytest.mark.parametrize(("frame", "axis"), [("", 0), ("world", 0), ("tb3", 1), ("tb3::base_scan", 1)])
def test_a_wrench_is_in_the_axes_of_its_frame(link: str, frame: str, axis: int) -> None:
    """The robot faces along the world's y axis and falls."""
    with run_joint_simulation() as on:
        yaw = Pose(position=Point(x=3.0, z=1.0), orientation=Quaternion.from_yaw(math.pi / 2))
        on.call(SPAWN, SpawnModel(name="tb3", model="burger", pose=yaw))
        twist = Wrench(torque=Vector3(x=0.01))
        on.call(APPLY_WRENCH, ApplyWrench(body_name=f"tb3::{link}", reference_frame=frame, wrench=twist, duration=1.0))
        on.run(0.05)
        spin = on.simulation.world.body("tb3").state().angular
        assert spin[axis] > 0.1
        assert abs(spin[1 - axis]) < 0.02


def test_wrenches_add_up_are_counted_cleared_and_end_with_their_body() -> None:
    with run_joint_simulation() as on:
        push = ApplyWrench(
            body_name="arm::bear_link",
            wrench=Wrench(force=Vector3(x=10.0)),
            duration=-1.0,
            reference_point=Point(y=-0.5),
        )
        for _ in range(2):
            assert "until it is cleared" in on.call(APPLY_WRENCH, push).text
        on.run(3.0)
        assert on.call(LINK_PROPERTIES, LinkName(link_name="arm::bear_link")).wrenches == 2
        assert on.call(CLEAR_WRENCH, LinkName(link_name="arm::bear_link")).text == "2 jobs of arm::bear_link cleared"
        assert "its base is fixed, so it will not move" in on.call(APPLY_WRENCH, ApplyWrench(body_name="arm")).text
        on.call(APPLY_WRENCH, push)
        on.call(DELETE, Name(name="arm"))
        on.call(SPAWN, SpawnModel(name="arm", model="arm"))
        assert on.call(LINK_PROPERTIES, LinkName(link_name="arm::bear_link")).wrenches == 0
        on.run(0.1)


def test_a_wrench_ends_with_the_entity_whose_axes_it_has() -> None:
    with run_joint_simulation(robot_entry("arm"), robot_entry("tb3", "burger", x=3.0)) as on:
        on.call(APPLY_WRENCH, ApplyWrench(body_name="arm::bear_link", reference_frame="tb3", duration=-1.0))
        on.call(DELETE, Name(name="tb3"))
        on.run(0.05)
        assert on.call(LINK_PROPERTIES, LinkName(link_name="arm::bear_link")).wrenches == 0
        assert "the wrenches on arm::bear_link are dropped" in on.log
