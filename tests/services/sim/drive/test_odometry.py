"""Odometry: integration of wheel angles and commands to a pose."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from services.sim.drive.kinematics import WheelGeometry
from services.sim.drive.odometry import initial_odometry, integrate_commands, integrate_encoders

SEPARATION, RADIUS = 0.16, 0.033
GEOMETRY = WheelGeometry(SEPARATION, RADIUS, RADIUS)


@given(st.floats(0.01, 1.0), st.floats(0.05, 3.0), st.booleans(), st.integers(3, 400), st.floats(-50, 50))
def test_a_circle_closes(v: float, w: float, left_turn: bool, pieces: int, angle: float) -> None:
    w = w if left_turn else -w
    dt = math.tau / abs(w) / pieces
    left, right = (v - w * SEPARATION / 2) / RADIUS, (v + w * SEPARATION / 2) / RADIUS
    track, open_loop = initial_odometry(angle, angle), initial_odometry(0.0, 0.0)
    for piece in range(1, pieces + 1):
        track = integrate_encoders(track, angle + left * dt * piece, angle + right * dt * piece, dt, GEOMETRY)
        open_loop = integrate_commands(open_loop, v, w, dt)
    for each in (track, open_loop):
        assert math.hypot(each.x, each.y) < 1e-9 * max(1.0, v / abs(w))
        assert each.heading == pytest.approx(math.copysign(math.tau, w), abs=1e-9), "unbounded, not wrapped to zero"


@given(st.floats(-1, 1), st.floats(-3, 3), st.floats(0.001, 0.1), st.floats(-3, 3))
def test_one_arc_is_exact_and_its_speeds_keep_their_sign(v: float, w: float, dt: float, heading: float) -> None:
    assume(abs(w) > 1e-3)
    track = integrate_encoders(
        initial_odometry(0.0, 0.0, 1.0, 2.0, heading),
        (v - w * SEPARATION / 2) * dt / RADIUS,
        (v + w * SEPARATION / 2) * dt / RADIUS,
        dt,
        GEOMETRY,
    )
    for each in (track, integrate_commands(initial_odometry(0.0, 0.0, 1.0, 2.0, heading), v, w, dt)):
        assert each.x == pytest.approx(1.0 + v / w * (math.sin(heading + w * dt) - math.sin(heading)), abs=1e-9)
        assert each.y == pytest.approx(2.0 - v / w * (math.cos(heading + w * dt) - math.cos(heading)), abs=1e-9)
        assert (each.v, each.w) == pytest.approx((v, w), abs=1e-9)


def test_straight_on_and_not_seeded_at_zero() -> None:
    track = integrate_encoders(initial_odometry(100.0, -7.0), 101.0, -6.0, 0.02, GEOMETRY)
    assert (track.x, track.y, track.heading) == pytest.approx((RADIUS, 0.0, 0.0))
    assert track.v == pytest.approx(RADIUS / 0.02)
    still = integrate_encoders(track, 101.0, -6.0, 0.02, GEOMETRY)
    assert (still.x, still.y, still.v, still.w) == (track.x, track.y, 0.0, 0.0)


def test_each_wheel_has_its_radius() -> None:
    track = integrate_encoders(initial_odometry(0.0, 0.0), 1.0, 1.0, 0.1, WheelGeometry(0.2, 0.09, 0.11))
    assert math.hypot(track.x, track.y) == pytest.approx(0.1, rel=1e-3)
    assert track.heading == pytest.approx(0.02 / 0.2)


@pytest.mark.parametrize("window", [1, 2, 10])
def test_the_speed_is_the_mean_over_the_window(window: int) -> None:
    track, ways = initial_odometry(0.0, 0.0), [0.1 * number for number in range(1, 25)]
    at = 0.0
    for count, way in enumerate(ways, 1):
        at += way
        track = integrate_encoders(track, at, at, 0.02, GEOMETRY, window)
        last = ways[max(0, count - window) : count]
        assert track.v == pytest.approx(sum(last) / len(last) * RADIUS / 0.02)
        assert len(track.recent) == len(last)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_angles_that_are_not_finite_change_nothing(bad: float) -> None:
    track = integrate_encoders(initial_odometry(0.0, 0.0), 1.0, 1.0, 0.02, GEOMETRY)
    assert integrate_encoders(track, bad, 1.0, 0.02, GEOMETRY) is track
    assert integrate_encoders(track, 1.0, bad, 0.02, GEOMETRY) is track


def test_an_instant_tells_a_way_but_no_speed() -> None:
    track = integrate_encoders(initial_odometry(0.0, 0.0), 1.0, 1.0, 0.02, GEOMETRY)
    later = integrate_encoders(track, 2.0, 2.0, 1e-6, GEOMETRY)
    assert later.x == pytest.approx(2 * RADIUS)
    assert later.v == track.v
