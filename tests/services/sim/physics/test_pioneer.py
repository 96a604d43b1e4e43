"""The Pioneer drives as commanded, and no obstacle that it pushes or grazes lifts or rolls it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from messages.se3 import Pose3
from models.model import read_model
from models.world import Box, WorldDescription
from services.sim.drive.limiter import WheelRamp
from services.sim.physics.world import BodyState
from tests.services.sim.physics.driven_robot import (
    DT,
    DrivenRobot,
    NewWorld,
    Spawner,
    drive_robots,
    placement_at,
    ramped_drive,
    robot_body,
    turned,
    wheels_of,
    yaw_of,
)

pytestmark = pytest.mark.slow

WHEELS = wheels_of(read_model("p3dx"))
FRONT, SIDE = 0.175, 0.19
"""The robot's extent from the middle of its axle [m]."""


def tilt(states: list[BodyState]) -> float:
    """Return the largest tilt from the vertical [deg]."""
    return max(math.degrees(2 * math.asin(math.hypot(*state.orientation[:2]))) for state in states)


def roll_of(state: BodyState) -> float:
    """Return the roll angle [deg]."""
    x, y, z, w = state.orientation
    return math.degrees(math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)))


def lift(states: list[BodyState]) -> float:
    return max(abs(state.position[2]) for state in states)


@pytest.mark.parametrize("speed", [1.2, 0.2, -0.5])
def test_straight_within_a_thousandth(spawn: Spawner, speed: float) -> None:
    robot = spawn(model="p3dx")
    before = drive_robots([robot], speed, 0.0, 1.0 + abs(speed) / WHEELS.acceleration)[-1]
    after = drive_robots([robot], speed, 0.0, 4.0)[-1]
    assert after.position[0] - before.position[0] == pytest.approx(4.0 * speed, rel=1e-3)
    assert abs(after.position[1]) < 5e-4
    assert abs(yaw_of(after)) < 5e-4


@pytest.mark.parametrize("rate", [5.235, 0.5, -1.0])
def test_spin_within_a_thousandth(spawn: Spawner, rate: float) -> None:
    robot = spawn(model="p3dx")
    drive_robots([robot], 0.0, rate, 1.0 + abs(rate) * WHEELS.separation / 2 / WHEELS.acceleration)
    states = drive_robots([robot], 0.0, rate, 4.0)
    assert turned(states) == pytest.approx((len(states) - 1) * DT * rate, rel=1e-3)
    assert math.hypot(*states[-1].position[:2]) < 1e-4, "it stays on its spot"


def test_an_arc_within_a_thousandth(spawn: Spawner) -> None:
    robot = spawn(model="p3dx")
    drive_robots([robot], 0.5, 1.0, 3.0)
    states = drive_robots([robot], 0.5, 1.0, math.tau)
    x, y = (
        (max(place) + min(place)) / 2
        for place in (tuple(state.position[axis] for state in states) for axis in range(2))
    )
    distances = [math.hypot(state.position[0] - x, state.position[1] - y) for state in states]
    assert distances == pytest.approx([0.5] * len(states), rel=1e-3)


def test_a_dead_stop_does_not_tip_it(spawn: Spawner) -> None:
    """The motors' torque limits the deceleration without a ramp."""
    robot = spawn(model="p3dx")
    drive_robots([robot], 0.75, 0.0, 4.0)
    robot.drive = replace(robot.drive, ramp=WheelRamp())
    assert tilt(drive_robots([robot], 0.0, 0.0, 2.0)) < 6.0


CRASHES = [
    (degrees, *either)
    for number, degrees in enumerate((0, 30, 45, 60, 80, 88))
    for either in (((0.75, 1.0), (1.2, 0.1)) if number % 2 else ((1.2, 1.0), (0.75, 0.1)))
]
"""Angles, speeds and wall heights: every pair of values occurs."""


@pytest.mark.parametrize(("degrees", "speed", "height"), CRASHES)
def test_a_wall_is_pushed_and_grazed_on_all_wheels(
    degrees: float, speed: float, height: float, new_world: NewWorld
) -> None:
    """``degrees`` is the angle to the wall's normal: 0 is head-on, 88 slides along it."""
    angle = math.radians(degrees)
    reach = max(FRONT * math.cos(angle) + SIDE * math.sin(angle), SIDE)
    states = _against_a_wall(new_world, placement_at(1.0 - reach - 1.2 * math.cos(angle), 0.0, angle), speed, height)
    _bumps_and_stays_down(states)
    assert states[-1].position[0] == pytest.approx(1.0 - FRONT, abs=0.016), "it has turned to the wall and stays there"


def test_backing_into_a_wall(new_world: NewWorld) -> None:
    _bumps_and_stays_down(_against_a_wall(new_world, placement_at(0.0, 0.0, math.pi), -0.75, 1.0))


@pytest.mark.parametrize("beside", [0.0, 0.1, 0.2])
def test_a_lower_robot_meets_the_fenders_and_gets_under_nothing(spawn: Spawner, beside: float) -> None:
    pioneer, burger = spawn("pioneer", "p3dx"), spawn("burger", "burger", at=placement_at(0.6, beside, math.pi))
    world, touched = pioneer.world, False
    for _ in range(40):
        states = drive_robots([pioneer, burger], 0.5, 0.0, 0.1)
        touched |= bool(world.contacts())
        assert tilt(states) < 0.5
        assert lift(states) < 1e-3
        assert tilt([world.body("burger").state()]) < 3.0
    assert touched


def _bumps_and_stays_down(states: list[BodyState]) -> None:
    """Assert that a crash at most pitches the robot, doesn't roll it, and leaves all wheels on the ground."""
    assert tilt(states) < 3.5
    assert lift(states) < 3e-3
    assert max(abs(roll_of(state)) for state in states) < 0.5
    assert tilt(states[-100:]) < 0.05
    assert lift(states[-100:]) < 1e-4


def _against_a_wall(new_world: NewWorld, at: Pose3, speed: float, height: float) -> list[BodyState]:
    """Drive for five seconds against a wall whose face is the plane x = 1 m."""
    wall = Box(name="wall", size=(0.2, 40.0, height), position=(1.1, 0.0, height / 2))
    with new_world(WorldDescription(boxes=(wall,))) as world:
        world.spawn(robot_body("robot", "p3dx", at))
        driver = replace(ramped_drive(WHEELS), ramp=WheelRamp(acceleration=1.0))
        states = drive_robots([DrivenRobot(world, "robot", driver)], speed, 0.0, 5.0)
        assert world.contacts()
        return states
