"""The steady law on a burger in PyBullet, each command one control period late."""

from __future__ import annotations

import math

import pytest

from models.figures import read_model
from models.scene import Scene
from services.motion.planar import STILL, Leg, Motion, Planar
from services.sim.diffdrive.driver import Drive
from services.sim.physics.bullet import BulletWorld
from services.waypoint import WaypointParameters
from services.waypoint.pilot import Pilot
from tests.physics.rig import STEP_NS, Driver, body, place, wheels_of, yaw_of
from tests.unit_waypoint.ideal_base import CONTROL

STEPS = round(CONTROL * 1e9 / STEP_NS)
CORNERS = ((0.0, 0.0), (1.0, 0.0), (0.2, -0.8), (0.5, 0.5))


def test_a_burger_keeps_to_its_legs_stops_on_its_points_and_takes_the_final_heading() -> None:
    pilot = Pilot(WaypointParameters(goals=CORNERS[1:], final_yaw=-1.0))
    stops: list[float] = []
    offsets: list[float] = []
    with BulletWorld(Scene(), STEP_NS) as world:
        world.spawn(body("burger", "burger", place(0, 0, 1.57)))
        base = Driver(world, "burger", Drive.of(wheels_of(read_model("burger"))))
        late = STILL
        for _ in range(1500):
            state = world.state("burger")
            yaw, velocity = yaw_of(state), state.linear
            here = Planar(state.position[0], state.position[1], yaw)
            moving = Motion(velocity[0] * math.cos(yaw) + velocity[1] * math.sin(yaw), state.angular[2])
            now = pilot.step(here, moving, CONTROL)
            offsets.append(Leg(*CORNERS[now.index], *CORNERS[now.index + 1]).left_and_offset(here)[1])
            if now.state == "reached":
                assert abs(moving.v) < 0.002
                stops.append(now.distance)
            if now.state == "finished":
                break
            for _ in range(STEPS):
                base.set(late.v, late.w)
                world.step()
            late = now.command or STILL
    assert now.state == "finished"
    assert len(stops) == 3
    assert max(stops) < 0.002
    assert max(map(abs, offsets)) < 0.002
    assert here.yaw == pytest.approx(-1.0, abs=0.02)
