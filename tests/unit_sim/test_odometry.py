"""Odometry from wheels and from the world, as mathematics."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from messages.std import Header, Time
from services.sim.odometry import EXACT, PLANAR, encoder_odometry, roll, start, world_odometry
from services.sim.world import BodyState

SEPARATION, RADIUS = 0.16, 0.033


@given(st.floats(0.01, 1.0), st.floats(0.05, 3.0), st.booleans(), st.integers(3, 400), st.floats(-50, 50))
def test_a_circle_closes(v: float, w: float, left_turn: bool, pieces: int, angle: float) -> None:
    w = w if left_turn else -w
    dt = math.tau / abs(w) / pieces
    left, right = (v - w * SEPARATION / 2) / RADIUS, (v + w * SEPARATION / 2) / RADIUS
    track = start(angle, angle)
    for piece in range(1, pieces + 1):
        track = roll(track, angle + left * dt * piece, angle + right * dt * piece, dt, SEPARATION, RADIUS)
    assert math.hypot(track.x, track.y) < 1e-9 * max(1.0, v / abs(w))
    assert track.heading == pytest.approx(math.copysign(math.tau, w), abs=1e-9), "unbounded, not wrapped to zero"


@given(st.floats(-1, 1), st.floats(-3, 3), st.floats(0.001, 0.1), st.floats(-3, 3))
def test_one_arc_is_exact_and_its_speeds_keep_their_sign(v: float, w: float, dt: float, heading: float) -> None:
    assume(abs(w) > 1e-3)
    track = roll(
        start(0.0, 0.0, 1.0, 2.0, heading),
        (v - w * SEPARATION / 2) * dt / RADIUS,
        (v + w * SEPARATION / 2) * dt / RADIUS,
        dt,
        SEPARATION,
        RADIUS,
    )
    assert track.x == pytest.approx(1.0 + v / w * (math.sin(heading + w * dt) - math.sin(heading)), abs=1e-9)
    assert track.y == pytest.approx(2.0 - v / w * (math.cos(heading + w * dt) - math.cos(heading)), abs=1e-9)
    assert (track.v, track.w) == pytest.approx((v, w), abs=1e-9)


def test_straight_on_and_not_seeded_at_zero() -> None:
    track = roll(start(100.0, -7.0), 101.0, -6.0, 0.02, SEPARATION, RADIUS)
    assert (track.x, track.y, track.heading) == pytest.approx((RADIUS, 0.0, 0.0))
    assert track.v == pytest.approx(RADIUS / 0.02)
    still = roll(track, 101.0, -6.0, 0.02, SEPARATION, RADIUS)
    assert (still.x, still.y, still.v, still.w) == (track.x, track.y, 0.0, 0.0)


def test_the_twist_of_the_world_is_turned_into_the_body() -> None:
    half = math.pi / 4
    state = BodyState((1.0, 2.0, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)), (0.0, 0.5, 0.0), (0.0, 0.0, 0.3))
    header = Header(stamp=Time.of(123), frame_id="world")
    odometry = world_odometry(state, header, "tb3_0/base_footprint")
    twist = odometry.twist.twist
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == pytest.approx((0.5, 0.0, 0.0), abs=1e-12)
    assert twist.angular.z == pytest.approx(0.3)
    assert odometry.pose.pose.orientation.yaw == pytest.approx(math.pi / 2)
    assert (odometry.header, odometry.child_frame_id) == (header, "tb3_0/base_footprint")
    assert odometry.pose.packed == odometry.twist.packed == EXACT


def test_the_covariance_is_the_plugin_s() -> None:
    odometry = encoder_odometry(start(0.0, 0.0, 1.0, 2.0, 4.0), Header(), "base")
    assert odometry.pose.covariance[::7] == (1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3)
    assert odometry.pose.packed == PLANAR
    assert odometry.pose.pose.position.x == 1.0
    assert odometry.pose.pose.orientation.yaw == pytest.approx(4.0 - math.tau)
