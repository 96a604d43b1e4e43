"""The steady law on a burger in PyBullet, each command one control period late."""

from __future__ import annotations

import math

import pytest

from messages.se2 import ZERO_TWIST, Pose2, Twist2
from models.model import read_model
from models.world import WorldDescription
from services.driving.guidance import Segment
from services.sim.engines import default_engine, open_world
from services.waypoint import WaypointParameters
from services.waypoint.controller import WaypointController
from tests.services.sim.physics.driven_robot import (
    STEP_NS,
    DrivenRobot,
    placement_at,
    ramped_drive,
    robot_body,
    wheels_of,
    yaw_of,
)
from tests.services.waypoint.ideal_base import CONTROL_S

STEPS = round(CONTROL_S * 1e9 / STEP_NS)
CORNERS = ((0.0, 0.0), (1.0, 0.0), (0.2, -0.8), (0.5, 0.5))


def test_a_burger_keeps_to_its_legs_stops_on_its_points_and_takes_the_final_heading() -> None:
    pilot = WaypointController(WaypointParameters(goals=CORNERS[1:], final_yaw=-1.0))
    stops: list[float] = []
    offsets: list[float] = []
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:
        world.spawn(robot_body("burger", "burger", placement_at(0, 0, 1.57)))
        base = DrivenRobot(world, "burger", ramped_drive(wheels_of(read_model("burger"))))
        late = ZERO_TWIST
        for _ in range(1500):
            state = world.body("burger").state()
            yaw, velocity = yaw_of(state), state.linear
            here = Pose2(state.position[0], state.position[1], yaw)
            moving = Twist2(velocity[0] * math.cos(yaw) + velocity[1] * math.sin(yaw), state.angular[2])
            now = pilot.step(here, moving, CONTROL_S)
            offsets.append(Segment(*CORNERS[now.index], *CORNERS[now.index + 1]).remaining_and_offset(here)[1])
            if now.state == "reached":
                assert abs(moving.v) < 0.002
                stops.append(now.distance)
            if now.state == "finished":
                break
            for _ in range(STEPS):
                base.set(late.v, late.w)
                world.step()
            late = now.command or ZERO_TWIST
    assert now.state == "finished"
    assert len(stops) == 3
    assert max(stops) < 0.002
    assert max(map(abs, offsets)) < 0.002
    assert here.yaw == pytest.approx(-1.0, abs=0.02)
