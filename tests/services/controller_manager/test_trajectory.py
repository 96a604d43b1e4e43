"""Splines between points, and the conversion of a message into segments."""

from __future__ import annotations

import math

import pytest

from messages.control import TrajectoryError
from messages.std import Duration, Header, Time
from messages.trajectory import JointTrajectory, JointTrajectoryPoint
from services.controller_manager.config import TrajectoryConfig
from services.controller_manager.trajectory import JointPoint, Segment, Trajectory, hold, segment
from services.controller_manager.trajectory_message import MAX_POINTS, BadTrajectory, plan
from tests.harness.cases import case

S = 1_000_000_000
TERMS = TrajectoryConfig(constraints={})
JOINTS = ("a", "b")


def point(seconds: float, positions: tuple[float, ...], **more: tuple[float, ...]) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(positions=positions, time_from_start=Duration.of(round(seconds * S)), **more)


def message(*points: JointTrajectoryPoint, names: tuple[str, ...] = JOINTS, stamp: float = 0.0) -> JointTrajectory:
    return JointTrajectory(header=Header(stamp=Time.of(round(stamp * S))), joint_names=names, points=points)


def followed(
    asked: JointTrajectory,
    now: float = 0.0,
    current: Trajectory | None = None,
    terms: TrajectoryConfig = TERMS,
    continuous: tuple[str, ...] = (),
) -> Trajectory:
    return plan(asked, JOINTS, continuous, terms, current or hold((0.0, 0.0), 0), round(now * S))


def derivative(each: Segment, t: float, order: int) -> float:
    """Return the first joint's velocity (``order`` 1) or acceleration (2), by central differences."""
    h = 100_000
    sample = [each.at(round(t * S) + k * h).positions[0] for k in (-1, 0, 1)]
    return (sample[2] - sample[0]) / (2 * h / S) if order == 1 else (sum(sample) - 3 * sample[1]) / (h / S) ** 2


def test_the_points_choose_the_spline_and_the_spline_meets_the_points() -> None:
    first, last = JointPoint((1.0,)), JointPoint((3.0,))
    linear = segment(S, 3 * S, first, last)
    assert linear.at(2 * S) == ((2.0,), (1.0,), (0.0,))

    cubic = segment(0, 2 * S, JointPoint((1.0,), (0.5,)), JointPoint((3.0,), (-1.0,)))
    assert cubic.at(0)[:2] == ((1.0,), (0.5,))
    before = cubic.at(2 * S - 1)
    assert before.positions[0] == pytest.approx(3.0, abs=1e-8)
    assert before.velocities[0] == pytest.approx(-1.0, abs=1e-7)

    quintic = segment(0, 2 * S, JointPoint((1.0,), (0.5,), (-0.2,)), JointPoint((3.0,), (-1.0,), (2.0,)))
    assert quintic.at(0) == ((1.0,), (0.5,), (-0.2,))
    before = quintic.at(2 * S - 1)
    assert [row[0] for row in before] == pytest.approx([3.0, -1.0, 2.0], abs=1e-6)
    for each in (cubic, quintic):
        for t in (0.3, 1.0, 1.7):
            told = each.at(round(t * S))
            assert told.velocities[0] == pytest.approx(derivative(each, t, 1), abs=1e-6)
            assert told.accelerations[0] == pytest.approx(derivative(each, t, 2), abs=1e-2)

    assert segment(0, S, JointPoint((1.0,), (0.5,)), last).at(S // 2).velocities == (2.0,), "one velocity is none"
    assert segment(0, 2 * S, first, last, splines=False).at(2 * S - 1).positions == (1.0,)
    for each in (linear, cubic, quintic):
        assert each.at(4 * S) == ((3.0,), (0.0,), (0.0,)), "it stays at its end"


def test_joints_in_another_order_and_parts_of_them() -> None:
    swapped = followed(message(point(1, (2.0, 1.0)), names=("b", "a")))
    assert swapped.at(S).positions == (1.0, 2.0)
    some = TrajectoryConfig(constraints={}, allow_partial_joints_goal=True)
    current = hold((0.5, -0.5), 0)
    partial = followed(message(point(1, (2.0,), velocities=(0.0,)), names=("b",)), current=current, terms=some)
    assert partial.at(S).positions == (0.5, 2.0)
    assert partial.at(S // 2).positions[0] == 0.5


def test_it_begins_at_what_is_wanted_then_and_follows_the_old_one_until_its_start() -> None:
    old = followed(message(point(2, (2.0, 0.0))))
    new = followed(message(point(1, (5.0, 0.0)), stamp=1.5), now=1.0, current=old)
    assert new.at(round(1.25 * S)).positions[0] == pytest.approx(1.25), "the old one, until 1.5 s"
    assert new.at(round(1.5 * S)).positions[0] == pytest.approx(1.5)
    assert new.at(2 * S).positions[0] == pytest.approx(1.5 + 0.5 * 3.5)
    assert new.end == round(2.5 * S)
    at_once = followed(message(point(1, (0.0, 0.0), velocities=(0.0, 0.0))), now=1.0, current=old)
    assert at_once.at(S).velocities[0] == pytest.approx(1.0), "it takes over the speed"


def test_points_of_the_past_are_left_out() -> None:
    points = [point(n, (float(n), 0.0)) for n in range(1, 5)]
    late = followed(message(*points, stamp=10.0), now=12.5)
    assert [each.end // S for each in late.segments] == [13, 14]
    assert late.at(13 * S).positions[0] == 3.0
    with pytest.raises(BadTrajectory, match=r"all its points are in the past: the last was due 6\.000 s ago") as told:
        followed(message(*points, stamp=10.0), now=20.0)
    assert told.value.code is TrajectoryError.OLD_HEADER_TIMESTAMP
    assert followed(message(point(0, (1.0, 1.0))), now=3.0).at(3 * S).positions == (1.0, 1.0), "at once"


def test_joints_that_turn_for_ever_take_the_shorter_way() -> None:
    for start, asked, end in ((3.0, -3.0, math.tau - 3.0), (0.0, 4 * math.pi + 0.1, 0.1), (-7.0, 0.0, -math.tau)):
        with case(start, asked):
            made = followed(message(point(1, (asked, asked))), current=hold((start, start), 0), continuous=("a",))
            assert made.at(S).positions == (pytest.approx(end), asked)
    twice = followed(message(point(1, (6.0, 0.0)), point(2, (9.0, 0.0))), continuous=("a",))
    assert twice.at(2 * S).positions[0] == pytest.approx(9.0 - math.tau), "all its points are shifted alike"


def test_what_cannot_be_followed_is_refused_with_its_code() -> None:
    fine = point(1, (1.0, 1.0))
    joints, goal = TrajectoryError.INVALID_JOINTS, TrajectoryError.INVALID_GOAL
    stops = TrajectoryConfig(constraints={}, allow_nonzero_velocity_at_trajectory_end=False)
    for asked, code, text in (
        (message(fine, names=()), joints, r"it names no joints \(the controller's: a, b\)"),
        (message(fine, names=("a", "bb")), joints, "unknown joint 'bb'; did you mean 'b'"),
        (message(fine, names=("a", "a")), joints, "it names the joint 'a' twice"),
        (message(point(1, (1.0,)), names=("a",)), joints, "the joints b are missing"),
        (message(), goal, "it has no points"),
        (message(point(1, (1.0,))), goal, "point 0 has 1 positions of 2 joints"),
        (message(point(1, (1.0, 1.0), velocities=(1.0,))), goal, "point 0 has 1 velocities of 2 joints"),
        (message(fine, fine), goal, "point 1 has time_from_start = 1 s, not later than the point before"),
        (message(point(-1, (1.0, 1.0))), goal, "time_from_start = -1 s, not from 0"),
        (message(fine, stamp=1e6), goal, "more than a day"),
        (message(*[fine] * (MAX_POINTS + 1)), goal, "10001 points, the limit is 10000"),
        (message(point(1, (1.0, 1.0), velocities=(0.0, 1.0))), goal, "its last point moves"),
    ):
        with case(text), pytest.raises(BadTrajectory, match=text) as told:
            followed(asked, terms=stops)
        assert told.value.code is code


def test_trajectories_that_are_only_put_in_a_queue_do_not_grow_without_end() -> None:
    points = [point(0.001 * n, (0.0, 0.0)) for n in range(1, 6001)]
    first = followed(message(*points, stamp=1.0))
    second = followed(message(*points, stamp=8.0), current=first)
    with pytest.raises(BadTrajectory, match="more than 10000 points are still to come"):
        followed(message(*points, stamp=15.0), current=second)
