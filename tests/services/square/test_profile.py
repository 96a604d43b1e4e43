"""The default law on an ideal base: it ends at its start, keeps its limits, and waits for slow or blocked bases."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.se2 import ZERO_TWIST, Pose2, wrap
from services.square import SquareParameters
from services.square.controller import SquareController
from services.square.corners import Square
from tests.services.square.ideal_base import CONTROL_S, IdealBase, SimulatedStep, drive

START = Pose2(0.7, -0.4, 2.9)


def closure(start: Pose2, end: Pose2) -> tuple[float, float]:
    """Return the distance [m] and angle [rad] between two poses."""
    return math.hypot(end.x - start.x, end.y - start.y), abs(wrap(end.yaw - start.yaw))


def test_corners_are_counted_from_the_start_to_the_left() -> None:
    square = Square(Pose2(1.0, 2.0, math.pi / 2), 0.5, 2)
    places = [(each.x, each.y) for each in square.corners()]
    assert places == [pytest.approx(each) for each in 2 * [(1.0, 2.5), (0.5, 2.5), (0.5, 2.0), (1.0, 2.0)]]
    assert [wrap(each.yaw - math.pi) for each in square.corners()[:2]] == pytest.approx([0, math.pi / 2])
    assert square.corner_count == 8
    assert Square(START, 1.0, 0).corner_count is None


def test_it_ends_where_it_began_and_reports_each_corner() -> None:
    run = list(drive(SquareParameters(), IdealBase(START)))
    off, turned = closure(START, run[-1].pose)
    assert off < 0.003
    assert math.degrees(turned) < 0.2
    reached = [each for each in run if each.move.state == "reached"]
    assert [each.move.index for each in reached] == [0, 1, 2, 3]
    for each, corner in zip(reached, Square(START, 1.0).corners(), strict=True):
        off, turned = closure(corner, each.pose)
        assert off < 0.005
        assert math.degrees(turned) < 0.2
        assert (each.velocity.v, each.velocity.w) == pytest.approx((0, 0), abs=0.02)
    assert run[-1].move.state == "finished"
    assert run[-1].time < 45


@pytest.mark.slow
@given(
    side=st.floats(0.2, 3.0),
    linear=st.floats(0.02, 1.5),
    angular=st.floats(0.1, 2.5),
    yaw=st.floats(-3.1, 3.1),
    rise=st.floats(0.05, 0.3),
)
@settings(max_examples=15, deadline=None)
def test_any_square_closes_within_the_limits(
    side: float, linear: float, angular: float, yaw: float, rise: float
) -> None:
    linear = max(linear, side / 40)  # at most 40 s per side
    p = SquareParameters(
        side=side, linear_speed=linear, angular_speed=angular, acceleration=rise, deceleration=rise, log=""
    )
    start = Pose2(3.0, -2.0, yaw)
    run = list(drive(p, IdealBase(start), 2000.0))
    assert run[-1].move.state == "finished"
    off, turned = closure(start, run[-1].pose)
    assert off < 0.01 + 0.01 * side
    assert math.degrees(turned) < 0.5
    for one, other in pairwise(each.move.command or ZERO_TWIST for each in run if each.move.state == "driving"):
        assert abs(other.v - one.v) <= rise * CONTROL_S + 1e-9
        assert abs(other.w - one.w) <= 2 * p.angular_acceleration * CONTROL_S + 1e-9
        assert abs(other.v) <= 1.2 * linear + 1e-9
        assert abs(other.w) <= 1.2 * angular + 1e-9


def test_the_desired_pose_is_that_of_its_time() -> None:
    run = [each for each in drive(SquareParameters(), IdealBase()) if each.move.phase == "drive"]
    behind = [math.hypot(each.move.desired.x - each.pose.x, each.move.desired.y - each.pose.y) for each in run]
    assert max(behind) < 0.02
    assert 0.4 < run[150].move.desired.x < 0.6


def test_a_base_slower_than_told_is_waited_for() -> None:
    run = list(drive(SquareParameters(linear_speed=0.5), IdealBase(START, top=0.1)))
    assert run[-1].move.state == "finished"
    assert closure(START, run[-1].pose)[0] < 0.01
    assert max(_behind(each) for each in run) < 0.15


def _behind(now: SimulatedStep) -> float:
    return math.hypot(now.move.desired.x - now.pose.x, now.move.desired.y - now.pose.y)


def test_after_a_silence_it_goes_on_from_where_it_is() -> None:
    pilot, base = SquareController(SquareParameters(log="")), IdealBase()
    for tick in range(100):
        base.run(pilot.step(tick, base.pose, base.velocity, CONTROL_S).command or ZERO_TWIST)
    assert pilot.hold().command == ZERO_TWIST
    assert pilot.hold().state == "waiting"
    for _ in range(100):
        base.run(ZERO_TWIST)
    stood = base.pose
    first = pilot.step(300, base.pose, base.velocity, CONTROL_S)
    assert first.state == "driving"
    assert first.command is not None
    assert 0 <= first.command.v <= 0.25 * CONTROL_S + 1e-9
    assert math.hypot(first.desired.x - stood.x, first.desired.y - stood.y) < 0.01
    for tick in range(3000):
        base.run(pilot.step(tick, base.pose, base.velocity, CONTROL_S).command or ZERO_TWIST)
    assert closure(Pose2(0, 0), base.pose)[0] < 0.005


def test_a_robot_that_was_carried_away_stands_still_until_it_is_brought_back() -> None:
    pilot, base = SquareController(SquareParameters(log="")), IdealBase()
    for tick in range(100):
        base.run(pilot.step(tick, base.pose, base.velocity, CONTROL_S).command or ZERO_TWIST)
    before = base.pose
    base.pose = Pose2(before.x, before.y + 2.0, before.yaw)
    for tick in range(10):
        move = pilot.step(tick, base.pose, base.velocity, CONTROL_S)
        assert (move.state, move.phase, move.command) == ("waiting", "astray", ZERO_TWIST)
    base.pose = before
    assert pilot.step(0, base.pose, base.velocity, CONTROL_S).state == "driving"


def test_out_of_patience_it_goes_on() -> None:
    pilot, held = SquareController(SquareParameters(side=0.2, patience=1.0, log="")), IdealBase()
    late = False
    for tick in range(500):
        move = pilot.step(tick, held.pose, ZERO_TWIST, CONTROL_S)
        late = late or move.timed_out
        if move.phase == "drive" and held.pose.x < 0.19:
            held.pose = Pose2(min(0.19, move.desired.x), 0.0)
    assert late
    assert move.phase == "turn"


def test_an_endless_drive_has_no_end() -> None:
    p = SquareParameters(side=0.2, count=0, linear_speed=0.5, angular_speed=2.0, log="")
    run = list(drive(p, IdealBase(), 120.0))
    assert max(each.move.index for each in run) > 8
    assert all(each.move.state != "finished" for each in run)
