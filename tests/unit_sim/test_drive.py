"""The ramp from commands to wheel speeds: limits hold for every sequence, and targets are reached exactly."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from services.sim.drive import AT_REST, Limits, Rims, advance, target, wheel_speeds

from models.figures import read_model

DT = 0.005
WHEELS = read_model("burger").wheels
assert WHEELS is not None
BURGER = Limits.of(WHEELS)
PLUGIN = Limits.of(WHEELS, clamp=False, jump=0.01)

speeds = st.floats(-100, 100)
rates = st.floats(-1000, 1000)
commands = st.lists(st.tuples(speeds, rates, st.booleans()), min_size=1, max_size=60)


@given(commands)
def test_no_wheel_leaves_its_limits_or_changes_faster_than_the_ramp(series: list[tuple[float, float, bool]]) -> None:
    rims = AT_REST
    fastest = BURGER.max_linear + BURGER.max_angular * BURGER.separation / 2
    for v, w, braking in series:
        after = advance(BURGER, rims, v, w, braking, DT)
        most = (BURGER.brake if braking else BURGER.acceleration) * DT
        for old, new in zip(rims, after, strict=True):
            assert abs(new) <= fastest * (1 + 1e-12)
            assert abs(new - old) <= most * (1 + 1e-9)
        rims = after


@given(speeds, rates)
def test_the_target_is_clamped_axis_by_axis(v: float, w: float) -> None:
    left, right = target(BURGER, v, w)
    assert abs((left + right) / 2) <= BURGER.max_linear + 1e-12
    assert abs((right - left) / BURGER.separation) <= BURGER.max_angular + 1e-9
    if abs(v) < 0.22 and abs(w) < 2.84:
        assert (left + right) / 2 == pytest.approx(v, abs=1e-12)
        assert (right - left) / BURGER.separation == pytest.approx(w, abs=1e-9)


@given(commands)
def test_braking_ends_at_exactly_zero_within_the_time_of_the_brake(series: list[tuple[float, float, bool]]) -> None:
    rims = AT_REST
    for v, w, braking in series:
        rims = advance(BURGER, rims, v, w, braking, DT)
    fastest = max(abs(rims.left), abs(rims.right))
    for _ in range(math.ceil(fastest / (BURGER.brake * DT)) + 1):
        rims = advance(BURGER, rims, 9.0, 9.0, True, DT)
    assert rims == AT_REST


def test_the_ramp_from_rest_is_v_equals_a_t() -> None:
    rims = AT_REST
    for step in range(1, 41):
        rims = advance(BURGER, rims, 0.2, 0.0, False, DT)
        assert rims.left == rims.right == pytest.approx(min(step * DT * 1.0, 0.2), abs=1e-12)
    assert rims == Rims(0.2, 0.2)


def test_the_same_state_comes_back_when_nothing_changes() -> None:
    rims = Rims(0.2, 0.2)
    assert advance(BURGER, rims, 0.2, 0.0, False, DT) is rims
    assert advance(BURGER, AT_REST, 0.2, 0.0, True, DT) is AT_REST


def test_the_plugin_jumps_both_wheels_when_one_is_near_its_target() -> None:
    assert advance(PLUGIN, AT_REST, 0.3, 0.0, False, DT) == Rims(0.005, 0.005)
    near = Rims(0.295, 0.295)
    assert advance(PLUGIN, near, 0.3, 0.0, False, DT) == Rims(0.3, 0.3)
    turn = advance(PLUGIN, Rims(0.3, 0.3), 0.35, 0.625, False, DT)
    assert turn == pytest.approx((0.3, 0.4)), "the left wheel is at its target, so the right one jumps by 0.1 m/s"
    assert advance(BURGER, Rims(0.1, 0.1), 0.14, 0.5, False, DT) == pytest.approx((0.1, 0.105)), "ours ramps it"


def test_without_the_clamp_any_speed_is_the_target() -> None:
    assert target(PLUGIN, 0.707, 2.2) == Rims(0.707 - 2.2 * 0.08, 0.707 + 2.2 * 0.08)


def test_wheel_speeds_are_rim_speeds_over_the_radius() -> None:
    assert wheel_speeds(BURGER, Rims(0.033, -0.066)) == pytest.approx((1.0, -2.0))
