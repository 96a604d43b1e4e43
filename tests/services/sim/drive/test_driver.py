"""Wheel speeds from commands: limits hold for every sequence, targets are reached exactly, curvature can be kept."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.model import read_model
from services.sim.drive.driver import AT_REST, Drive, DriveState, commanded_velocity, step_drive, wheel_speeds
from services.sim.drive.kinematics import WheelGeometry, body_velocity, rim_speeds
from services.sim.drive.limiter import AxisLimits, braking_limits
from tests.services.sim.physics.driven_robot import ramped_drive

DT = 0.005
WHEELS = read_model("burger").wheels
assert WHEELS is not None
BURGER = ramped_drive(WHEELS)
PLUGIN = ramped_drive(WHEELS, clamp=False, jump=0.01)
LINEAR = AxisLimits(-0.5, 0.75, 0.3, 0.6, 0.2, 0.4)
ANGULAR = AxisLimits(-1.7, 1.7, 1.7, 1.7, 1.7, 1.7)
PIONEER = Drive(
    WheelGeometry(0.33, 0.0975, 0.0975),
    LINEAR,
    ANGULAR,
    braking_limits(LINEAR, 1.5),
    braking_limits(ANGULAR, 9.0),
    keep_curvature=False,
)

speeds = st.floats(-100, 100)
rates = st.floats(-1000, 1000)
commands = st.lists(st.tuples(speeds, rates, st.booleans()), min_size=1, max_size=60)


def rims(state: DriveState) -> tuple[float, float]:
    return state.left, state.right


def at(left: float, right: float) -> DriveState:
    """Return the state of a burger with these rim speeds [m/s]."""
    v, w = body_velocity(BURGER.geometry, left, right)
    return DriveState(v, w, v, w, left, right)


@given(commands)
def test_no_wheel_leaves_its_limits_or_changes_faster_than_the_ramp(series: list[tuple[float, float, bool]]) -> None:
    state = AT_REST
    fastest = WHEELS.max_linear + WHEELS.max_angular * WHEELS.separation / 2
    for v, w, stopping in series:
        after = step_drive(BURGER, state, v, w, stopping, DT)
        most = (WHEELS.brake if stopping else WHEELS.acceleration) * DT
        for old, new in zip(rims(state), rims(after), strict=True):
            assert abs(new) <= fastest * (1 + 1e-12)
            assert abs(new - old) <= most * (1 + 1e-9)
        state = after


@given(commands)
def test_a_base_with_limits_of_its_own_keeps_them(series: list[tuple[float, float, bool]]) -> None:
    state = AT_REST
    for v, w, stopping in series:
        after = step_drive(PIONEER, state, v, w, stopping, DT)
        assert -0.5 <= after.v <= 0.75
        assert abs(after.w) <= 1.7
        slower, faster = (1.5, 1.5) if stopping else (0.6, 0.3)
        assert -slower * DT <= (after.v - state.v) * (1 - 1e-9) <= max(faster, 0.4, slower * stopping) * DT
        assert abs(after.w - state.w) <= (9.0 if stopping else 1.7) * DT * (1 + 1e-9)
        assert rims(after) == rim_speeds(PIONEER.geometry, after.v, after.w)
        assert commanded_velocity(PIONEER, after) == (after.v, after.w)
        state = after


@given(speeds, rates)
def test_the_target_is_clamped_axis_by_axis(v: float, w: float) -> None:
    state = step_drive(BURGER, AT_REST, v, w, False, 1e3)
    drives, turns = body_velocity(BURGER.geometry, *rims(state))
    assert abs(drives) <= WHEELS.max_linear + 1e-12
    assert abs(turns) <= WHEELS.max_angular + 1e-9
    if abs(v) < 0.22 and abs(w) < 2.84:
        assert drives == pytest.approx(v, abs=1e-12)
        assert turns == pytest.approx(w, abs=1e-9)
    assert commanded_velocity(BURGER, state) == (drives, turns)


@given(commands, st.sampled_from([BURGER, PIONEER]))
def test_braking_ends_at_exactly_zero_within_the_time_of_the_brake(
    series: list[tuple[float, float, bool]], drive: Drive
) -> None:
    state = AT_REST
    for v, w, stopping in series:
        state = step_drive(drive, state, v, w, stopping, DT)
    time = max(abs(state.left), abs(state.right)) / WHEELS.brake
    if drive is PIONEER:
        time = max(abs(state.v) / 1.5, abs(state.w) / 9.0)
    for _ in range(math.ceil(time / DT) + 1):
        state = step_drive(drive, state, 9.0, 9.0, True, DT)
    assert state == AT_REST


def test_the_ramp_from_rest_is_v_equals_a_t() -> None:
    state = AT_REST
    for step in range(1, 41):
        state = step_drive(BURGER, state, 0.2, 0.0, False, DT)
        assert state.left == state.right == pytest.approx(min(step * DT * 1.0, 0.2), abs=1e-12)
    assert rims(state) == (0.2, 0.2)


def test_the_command_after_limits_is_v_equals_a_t() -> None:
    state = AT_REST
    for step in range(1, 600):
        state = step_drive(PIONEER, state, 0.75, 0.0, False, DT)
        assert commanded_velocity(PIONEER, state)[0] == pytest.approx(min(step * DT * 0.3, 0.75), abs=1e-12)


@pytest.mark.parametrize("drive", [BURGER, PIONEER, replace(PIONEER, keep_curvature=True)])
def test_the_same_state_comes_back_when_nothing_changes(drive: Drive) -> None:
    state = AT_REST
    for _ in range(2000):
        state = step_drive(drive, state, 0.2, 0.1, False, DT)
    assert step_drive(drive, state, 0.2, 0.1, False, DT) is state
    assert step_drive(drive, AT_REST, 0.2, 0.0, True, DT) is AT_REST


def test_the_plugin_jumps_both_wheels_when_one_is_near_its_target() -> None:
    assert rims(step_drive(PLUGIN, AT_REST, 0.3, 0.0, False, DT)) == (0.005, 0.005)
    assert rims(step_drive(PLUGIN, at(0.295, 0.295), 0.3, 0.0, False, DT)) == (0.3, 0.3)
    turn = rims(step_drive(PLUGIN, at(0.3, 0.3), 0.35, 0.625, False, DT))
    assert turn == pytest.approx((0.3, 0.4)), "the left wheel is at its target, so the right one jumps by 0.1 m/s"
    ours = rims(step_drive(BURGER, at(0.1, 0.1), 0.14, 0.5, False, DT))
    assert ours == pytest.approx((0.1, 0.105)), "ours ramps it"


def test_without_the_clamp_any_speed_is_the_target() -> None:
    state = step_drive(PLUGIN, AT_REST, 0.707, 2.2, False, 1e3)
    assert rims(state) == (0.707 - 2.2 * 0.08, 0.707 + 2.2 * 0.08)


def test_wheel_speeds_are_rim_speeds_over_the_radii() -> None:
    assert wheel_speeds(BURGER, at(0.033, -0.066)) == pytest.approx((1.0, -2.0))
    uneven = replace(BURGER, geometry=WheelGeometry(0.16, 0.033, 0.066))
    assert wheel_speeds(uneven, at(0.033, -0.066)) == pytest.approx((1.0, -1.0))


@settings(deadline=None, max_examples=50)
@given(st.floats(-3, 3), st.floats(-6, 6))
def test_a_curve_is_kept_while_the_base_speeds_up(v: float, w: float) -> None:
    drive, state = replace(PIONEER, keep_curvature=True), AT_REST
    for _ in range(600):
        after = step_drive(drive, state, v, w, False, DT)
        assert after.v * w == pytest.approx(v * after.w, abs=1e-9), "the ratio of the command"
        assert -0.2 * DT <= (after.v - state.v) * (1 - 1e-9) <= 0.3 * DT
        assert abs(after.w - state.w) <= 1.7 * DT * (1 + 1e-9)
        state = after
    ends = (v, -0.5, 0.75), (w, -1.7, 1.7)
    assert any(got == pytest.approx(end) for got, all_ in zip(state, ends, strict=False) for end in all_)


def test_without_it_the_slower_axis_bends_the_way() -> None:
    state = step_drive(PIONEER, AT_REST, 0.5, 0.5, False, DT)
    assert (state.v, state.w) == pytest.approx((0.3 * DT, 1.7 * DT))
