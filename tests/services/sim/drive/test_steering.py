"""Ackermann's geometry, and the commands of a base with steered wheels."""

from __future__ import annotations

import math

import pytest

from models.model import SteeredWheel, SteeringConfig
from services.sim.drive.driver import AT_REST, Drive, step_drive
from services.sim.drive.kinematics import WheelGeometry
from services.sim.drive.limiter import AxisLimits
from services.sim.drive.steering import Steering

STEERING = Steering.of(
    SteeringConfig(
        wheels=(
            SteeredWheel(joint="left", ahead=0.5, left=0.2),
            SteeredWheel(joint="right", ahead=0.5, left=-0.2, reversed=True),
        ),
        max_curvature=1.0,
        torque=1.0,
        rate=1.0,
    )
)
DRIVE = Drive(WheelGeometry(0.4, 0.1, 0.1), linear=AxisLimits(-1.0, 1.0), steering=STEERING)


def test_each_wheel_stands_at_right_angles_to_the_way_to_the_turning_point() -> None:
    left, right = STEERING.wheel_angles(math.atan(0.5 * 0.8))
    assert left == pytest.approx(math.atan2(0.5, 1 / 0.8 - 0.2)), "the one inside of the curve turns farther"
    assert right == pytest.approx(-math.atan2(0.5, 1 / 0.8 + 0.2)), "its joint turns to the right"


def test_it_turns_as_its_wheels_stand_and_only_while_it_drives() -> None:
    state = AT_REST
    for _ in range(400):
        state = step_drive(DRIVE, state, 0.5, 0.25, False, 0.005)
    assert (state.v, state.w) == pytest.approx((0.5, 0.25))
    assert (state.left, state.right) == pytest.approx((0.45, 0.55))
    assert step_drive(DRIVE, state, 0.5, 0.25, False, 0.005) is state
    stopped = step_drive(DRIVE, state, 0.5, 0.25, True, 0.005)
    assert (stopped.v, stopped.w, stopped.steer) == (0.0, 0.0, state.steer), "it brakes on its curve"


def test_a_turn_on_the_spot_only_turns_the_wheels() -> None:
    state = AT_REST
    for _ in range(400):
        state = step_drive(DRIVE, state, 0.0, -1.0, False, 0.005)
    assert (state.v, state.w) == (0.0, 0.0)
    assert STEERING.curvature(state.steer) == pytest.approx(-1.0)


def test_no_curve_is_tighter_than_the_wheels_turn_and_backwards_the_rate_keeps_its_side() -> None:
    assert STEERING.curvature(STEERING.goal(0.1, 5.0, 0.0)) == pytest.approx(1.0)
    assert STEERING.goal(-0.5, 0.25, 0.0) == pytest.approx(-math.atan(0.25))
