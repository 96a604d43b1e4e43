"""The limits of one axis: never exceeded, symmetric, exact at any step size, with jerk as in ROS 2 or ROS 1."""

from __future__ import annotations

from itertools import pairwise
from math import copysign, inf

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from services.sim.drive.limiter import UNLIMITED, AxisLimits, braking_limits, limit

sizes = st.floats(0.05, 50) | st.just(inf)
steps = st.sampled_from([0.001, 0.005, 0.02, 0.1])
wishes = st.lists(st.floats(-100, 100), min_size=1, max_size=80)
axes = st.builds(
    AxisLimits,
    min_velocity=st.floats(-20, 0),
    max_velocity=st.floats(0, 20),
    accelerate=sizes,
    decelerate=sizes,
    accelerate_reverse=sizes,
    decelerate_reverse=sizes,
    min_jerk=sizes.map(lambda size: -size),
    max_jerk=sizes,
    ros1_jerk=st.booleans(),
)
ROUNDING = 1e-9


def run(axis: AxisLimits, series: list[float], dt: float) -> list[float]:
    """Return the limited speeds, preceded by two zeros at rest."""
    speeds = [0.0, 0.0]
    for wanted in series:
        speeds.append(limit(axis, wanted, speeds[-1], speeds[-2], dt))
    return speeds


def mirrored(axis: AxisLimits) -> AxisLimits:
    return AxisLimits(
        -axis.max_velocity,
        -axis.min_velocity,
        axis.accelerate_reverse,
        axis.decelerate_reverse,
        axis.accelerate,
        axis.decelerate,
        -axis.max_jerk,
        -axis.min_jerk,
        axis.ros1_jerk,
    )


@given(axes, wishes, steps)
def test_velocity_and_acceleration_are_never_exceeded(axis: AxisLimits, series: list[float], dt: float) -> None:
    for last, speed in pairwise(run(axis, series, dt)[1:]):
        assert axis.min_velocity <= speed <= axis.max_velocity
        change = speed - last
        if last > 0 > speed or last < 0 < speed:
            first, then = (
                (axis.decelerate, axis.accelerate_reverse) if last > 0 else (axis.decelerate_reverse, axis.accelerate)
            )
            assert abs(last) / first + abs(speed) / then <= dt * (1 + ROUNDING), "each part at its own rate"
            continue
        side = last if last else speed
        up, down = (
            (axis.accelerate, axis.decelerate) if side >= 0 else (axis.decelerate_reverse, axis.accelerate_reverse)
        )
        assert -down * dt * (1 + ROUNDING) - 1e-15 <= change <= up * dt * (1 + ROUNDING) + 1e-15


@given(axes, wishes, steps)
def test_left_is_the_mirror_of_right(axis: AxisLimits, series: list[float], dt: float) -> None:
    there = run(axis, series, dt)
    assert run(mirrored(axis), [-each for each in series], dt) == [-each for each in there]


@given(
    st.floats(0.05, 20), st.floats(0.05, 20), st.floats(0.05, 20), st.floats(-10, 10), st.floats(-10, 10),
    st.floats(0.001, 1.0), st.integers(1, 20),
)  # fmt: skip
def test_a_step_is_exact_however_it_is_divided(
    up: float, down: float, back: float, start: float, wanted: float, time: float, parts: int
) -> None:
    axis = AxisLimits(accelerate=up, decelerate=down, accelerate_reverse=back, decelerate_reverse=up)
    speed = start
    for _ in range(parts):
        speed = limit(axis, wanted, speed, speed, time / parts)
    assert speed == pytest.approx(limit(axis, wanted, start, start, time), abs=1e-9)


@pytest.mark.slow
@given(axes, wishes, steps)
def test_as_ros2_acceleration_grows_no_faster_than_the_jerk(axis: AxisLimits, series: list[float], dt: float) -> None:
    assume(not axis.ros1_jerk)
    speeds = run(axis, series, dt)
    for before, last, speed in zip(speeds, speeds[1:], speeds[2:], strict=False):
        had, gets = last - before, speed - last
        if (gets - had) * gets > 0 and had * gets >= 0 and axis.min_velocity < speed < axis.max_velocity:
            square = dt * dt * (1 + ROUNDING)
            assert axis.min_jerk * square - 1e-12 <= gets - had <= axis.max_jerk * square + 1e-12


@given(sizes, st.floats(0.05, 20), st.floats(-5, 5), steps)
def test_as_ros2_no_target_is_overshot(jerk: float, rise: float, wanted: float, dt: float) -> None:
    axis = AxisLimits(accelerate=rise, decelerate=rise, accelerate_reverse=rise, decelerate_reverse=rise,
                min_jerk=-jerk, max_jerk=jerk)  # fmt: skip
    for speed in run(axis, [wanted] * 200, dt):
        assert abs(speed) <= abs(wanted)
        assert speed == 0 or copysign(1, speed) == copysign(1, wanted)


def test_as_ros1_jerk_is_doubled_and_swings() -> None:
    honest, doubled = AxisLimits(min_jerk=-5, max_jerk=5), AxisLimits(min_jerk=-5, max_jerk=5, ros1_jerk=True)
    dt = 0.01
    assert run(honest, [1.0], dt)[-1] == pytest.approx(5 * dt * dt)
    assert run(doubled, [1.0], dt)[-1] == pytest.approx(2 * 5 * dt * dt)
    assert max(run(doubled, [1.0] * 300, dt)) > 1.2
    assert max(run(honest, [1.0] * 300, dt)) == 1.0


def test_a_jerk_limited_start_is_a_parabola_then_a_line() -> None:
    """v = j t^2 / 2 up to t = a / j, then slope a; the discrete sum is j t dt / 2 above the parabola."""
    axis, dt = AxisLimits(accelerate=1.0, min_jerk=-5, max_jerk=5), 0.001
    speeds = run(axis, [10.0] * 500, dt)[2:]
    assert speeds[99] == pytest.approx(5 * 0.1**2 / 2, abs=5 * 0.1 * dt)
    assert speeds[499] == pytest.approx(0.1 + 0.3, abs=2 * dt)


def test_deceleration_and_reverse_have_limits_of_their_own() -> None:
    axis = AxisLimits(accelerate=1.0, decelerate=2.0, accelerate_reverse=3.0, decelerate_reverse=4.0)
    assert limit(axis, 9, 0.5, 0.5, 0.1) == pytest.approx(0.6)
    assert limit(axis, 0, 0.5, 0.5, 0.1) == pytest.approx(0.3)
    assert limit(axis, -9, 0.0, 0.0, 0.1) == pytest.approx(-0.3)
    assert limit(axis, 0, -0.5, -0.5, 0.1) == pytest.approx(-0.1)
    assert limit(axis, -9, 0.1, 0.1, 0.1) == pytest.approx(-0.15), "0.05 s to stop, 0.05 s to go back"
    assert limit(axis, 9, -0.2, -0.2, 0.1) == pytest.approx(0.05)


def test_a_lowered_velocity_counts_at_once_as_in_ros() -> None:
    assert limit(AxisLimits(max_velocity=0.3, accelerate=0.1, decelerate=0.1), 1.0, 0.8, 0.8, 0.01) == 0.3


def test_the_brake_replaces_what_slows_down_and_knows_no_jerk() -> None:
    axis = braking_limits(AxisLimits(-1, 1, 0.3, 0.3, 0.3, 0.3, -0.1, 0.1), 1.5)
    for start in (0.75, -0.75):
        speed, count = start, 0
        while speed:
            speed = limit(axis, 0.0, speed, speed - 0.1, 0.005)
            count += 1
        assert count in (100, 101), "v / a / dt, with one more where the sum of the steps falls short of it"


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_without_limits_a_wish_is_a_command(wanted: float, last: float) -> None:
    assert limit(UNLIMITED, wanted, last, -last, 0.005) == wanted
