"""Numeric tests of both control laws."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from messages.se2 import Pose2, Twist2, wrap
from services.driving.guidance import Segment, limit_slew, line_of_sight_heading, stopping_speed, turn_rate
from services.waypoint.controller import tutorial_command


def quadrants(x: float, y: float, yaw: float, goal_x: float, goal_y: float) -> float:
    """Return the original's heading error [rad]: eight cases of atan, yaw in [0, 2 pi), one wrap."""
    dx, dy = goal_x - x, goal_y - y
    yaw = yaw + 2 * math.pi if yaw < 0 else yaw
    if dx == 0:
        bearing = 0.5 * math.pi if dy > 0 else 1.5 * math.pi
    elif dx < 0:
        bearing = math.pi if dy == 0 else math.atan(dy / dx) + math.pi
    else:
        bearing = math.atan(dy / dx) + (2 * math.pi if dy < 0 else 0)
    error = bearing - yaw
    return error + 2 * math.pi if error < -math.pi else error - 2 * math.pi if error > math.pi else error


coordinate = st.floats(-10, 10).map(lambda value: round(value, 3))


@given(coordinate, coordinate, st.floats(-3.14, 3.14), coordinate, coordinate)
def test_the_tutorial_law_is_the_original(x: float, y: float, yaw: float, goal_x: float, goal_y: float) -> None:
    assume((x, y) != (goal_x, goal_y))
    command = tutorial_command(Pose2(x, y, yaw), goal_x, goal_y)
    assert command.v == pytest.approx(0.1 * math.hypot(goal_x - x, goal_y - y))
    assert abs(wrap(command.w / 0.7 - quadrants(x, y, yaw, goal_x, goal_y))) < 1e-9
    assert abs(command.w) <= 0.7 * math.pi + 1e-9


def test_the_tutorial_law_asks_what_a_burger_cannot_do() -> None:
    assert tutorial_command(Pose2(0, 0, 0), 5, -5).v == pytest.approx(0.7071, abs=1e-4)


@given(st.floats(1e-6, 100), st.floats(0.1, 1), st.floats(0.15, 1))
def test_from_the_braking_speed_the_distance_suffices(left: float, deceleration: float, lag: float) -> None:
    v = stopping_speed(left, 1e9, deceleration, lag)
    assert v * v / (2 * deceleration) + v * lag == pytest.approx(left, rel=1e-6)
    assert stopping_speed(left, 0.22, deceleration, lag) <= 0.22


def test_past_the_point_nothing_drives_on() -> None:
    assert stopping_speed(0, 0.22, 0.5, 0.2) == 0
    assert stopping_speed(-0.1, 0.22, 0.5, 0.2) == 0


def test_turning_goes_the_short_way() -> None:
    assert turn_rate(0.5, 1.5, 3, 0.2) == -turn_rate(-0.5, 1.5, 3, 0.2) > 0
    assert turn_rate(math.pi, 1.5, 3, 0.2) == 1.5
    assert wrap(1.5 * math.pi) == pytest.approx(-0.5 * math.pi)


def test_the_course_leads_back_onto_the_leg() -> None:
    leg = Segment(0, 0, 10, 0)
    assert line_of_sight_heading(leg, Pose2(1, 0), 0.3) == 0
    assert line_of_sight_heading(leg, Pose2(1, 0.3), 0.3) == pytest.approx(-math.pi / 4)
    assert line_of_sight_heading(leg, Pose2(1, -0.3), 0.3) == pytest.approx(math.pi / 4)


def test_a_leg_measures_along_and_across() -> None:
    left, offset = Segment(1, 1, 1, 5).remaining_and_offset(Pose2(0.5, 2))
    assert (left, offset) == pytest.approx((3, 0.5))
    assert Segment(1, 1, 1, 5).remaining_and_offset(Pose2(1, 6))[0] == pytest.approx(-1)


def test_a_command_changes_by_no_more_than_its_steps() -> None:
    up = limit_slew(Twist2(0.1, 0.0), Twist2(1.0, -9.0), 0.02, 0.04, 0.12)
    assert (up.v, up.w) == pytest.approx((0.12, -0.12))
    down = limit_slew(Twist2(0.1, 0.0), Twist2(0.0, 0.05), 0.02, 0.04, 0.12)
    assert (down.v, down.w) == pytest.approx((0.06, 0.05))
