"""Controller and ideal base together: laps, limits, stops, new goals, lost odometry."""

from __future__ import annotations

import itertools
import math

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages.se2 import ZERO_TWIST, Pose2, wrap
from services.driving.guidance import Segment
from services.driving.plan import Goal, Plan
from services.waypoint import WaypointParameters
from services.waypoint.controller import WaypointController
from tests.services.waypoint.ideal_base import CONTROL_S, IdealBase, SimulatedStep, drive

TEN = ((5, 0), (1, -4), (2.5, 2.5), (4, -4), (0, 0), (0, 2.5), (5, 2.5), (5, -4), (0, -4), (0, 0))
START_YAW = 1.57


def lap(shift: float = 0.0, law: str = "steady") -> list[SimulatedStep]:
    goals = tuple((float(x), y + shift) for x, y in TEN)
    parameters = WaypointParameters(goals=goals, law="tutorial" if law == "tutorial" else "steady")
    return list(drive(WaypointController(parameters), Pose2(0, shift, START_YAW), 400))


def reached(run: list[SimulatedStep]) -> list[int]:
    return [now.progress.index for now in run if now.progress.state == "reached"]


@pytest.fixture(scope="module")
def four_runs() -> list[list[SimulatedStep]]:
    return [lap(0.5 * robot) for robot in range(4)]


@pytest.mark.slow
def test_a_lap_stops_on_every_point_within_a_millimetre_and_in_time(four_runs: list[list[SimulatedStep]]) -> None:
    run = four_runs[0]
    assert run[-1].progress.state == "finished"
    assert reached(run) == list(range(10))
    for now in run:
        if now.progress.state == "reached":
            assert now.progress.distance < 0.002
            assert abs(now.velocity.v) < 0.01
    assert run[-1].time < 300


@pytest.mark.slow
def test_the_lap_keeps_to_its_legs(four_runs: list[list[SimulatedStep]]) -> None:
    corners = [(0.0, 0.0), *TEN]
    offsets = [
        Segment(*corners[now.progress.index], *corners[now.progress.index + 1]).remaining_and_offset(now.pose)[1]
        for now in four_runs[0]
    ]
    assert math.sqrt(sum(offset**2 for offset in offsets) / len(offsets)) < 0.001
    assert max(map(abs, offsets)) < 0.005


def test_four_robots_half_a_metre_apart_keep_their_distance(four_runs: list[list[SimulatedStep]]) -> None:
    """Same law, same shifted points, same start: the formation moves as one, so 0.5 m stays 0.5 m."""
    assert [len(reached(run)) for run in four_runs] == [10, 10, 10, 10]
    smallest = min(
        math.hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y)
        for together in zip(*four_runs, strict=True)
        for a, b in itertools.combinations(together, 2)
    )
    assert 0.49 < smallest < 0.51


def test_the_tutorial_law_cuts_its_corners_and_takes_as_long_as_computed() -> None:
    """Computed for the original without limits: 292 s; this base ramps its wheels at 1 m/s^2."""
    run = lap(law="tutorial")
    assert reached(run) == list(range(10))
    assert run[-1].time == pytest.approx(292, rel=0.03)
    assert all(0.29 < now.progress.distance < 0.3 for now in run if now.progress.state == "reached")


def test_endless_laps_begin_again() -> None:
    pilot = WaypointController(WaypointParameters(goals=((0.3, 0.0), (0.3, 0.3)), laps=0))
    run = list(drive(pilot, Pose2(0, 0), 60))
    assert reached(run)[:6] == [0, 1, 0, 1, 0, 1]
    assert run[-1].progress.state != "finished"


def test_two_laps_are_one_plan_of_twice_the_points() -> None:
    pilot = WaypointController(WaypointParameters(goals=((0.3, 0.0), (0.3, 0.3)), laps=2, final_yaw=1.0))
    run = list(drive(pilot, Pose2(0, 0), 60))
    assert reached(run) == [0, 1, 2, 3]
    assert run[-1].progress.count == 4
    assert wrap(run[-1].pose.yaw - 1.0) == pytest.approx(0, abs=0.02)


def test_a_goal_twice_in_the_list_is_reached_twice() -> None:
    run = list(drive(WaypointController(WaypointParameters(goals=((0.3, 0.0), (0.3, 0.0)))), Pose2(0, 0), 20))
    assert reached(run) == [0, 1]


def test_a_pilot_without_goals_commands_nothing_until_it_gets_one() -> None:
    pilot = WaypointController(WaypointParameters())
    assert pilot.step(Pose2(0, 0), ZERO_TWIST, CONTROL_S).command is None
    pilot.set_plan(Plan((Goal(0.5, 0.5, -2.0),)))
    last = list(drive(pilot, Pose2(0, 0), 30))[-1]
    assert last.progress.state == "finished"
    assert math.hypot(last.pose.x - 0.5, last.pose.y - 0.5) < 0.01
    assert abs(wrap(last.pose.yaw + 2.0)) < 0.02


def test_a_new_goal_on_the_way_replaces_the_plan_without_a_jerk() -> None:
    pilot, base = WaypointController(WaypointParameters(goals=((5.0, 0.0),))), IdealBase(Pose2(0, 0))
    commands = []
    for tick in range(600):
        if tick == 100:
            pilot.set_plan(Plan((Goal(0.0, 1.0),)))
        command = pilot.step(base.pose, base.velocity, CONTROL_S).command or ZERO_TWIST
        commands.append(command)
        base.run(command)
    assert math.hypot(base.pose.x, base.pose.y - 1) < 0.01
    assert max(abs(b.v - a.v) for a, b in itertools.pairwise(commands[:-1])) <= 0.5 * CONTROL_S + 1e-9


def test_other_gains_on_the_way_keep_the_plan_and_make_no_jerk() -> None:
    p = WaypointParameters(goals=((3.0, 0.0), (3.0, 1.0)))
    pilot, base = WaypointController(p), IdealBase(Pose2(0, 0))
    commands, speeds = [], {}
    changes = {
        100: {"max_linear": 0.1, "lookahead": 0.5},
        200: {"max_linear": 0.4, "acceleration": 0.2, "tolerance": 0.03},
    }
    for tick in range(900):
        if tick in changes:
            p = msgspec.structs.replace(p, **changes[tick])
            plan = pilot.plan
            pilot.reconfigure(p)
            assert pilot.plan is plan
        command = pilot.step(base.pose, base.velocity, CONTROL_S).command or ZERO_TWIST
        commands.append(command)
        speeds[tick] = command.v
        base.run(command)
    assert (speeds[99], speeds[199], max(speeds.values())) == (0.22, 0.1, pytest.approx(0.4, abs=0.05))
    assert math.hypot(base.pose.x - 3, base.pose.y - 1) < 0.03
    steps = [b.v - a.v for a, b in itertools.pairwise(commands)]
    assert min(steps) >= -0.5 * CONTROL_S - 1e-9
    assert max(steps) <= 0.5 * CONTROL_S + 1e-9


def test_without_odometry_it_stands_and_then_goes_on() -> None:
    pilot = WaypointController(WaypointParameters(goals=((2.0, 0.0),)))
    half = list(drive(pilot, Pose2(0, 0), 5))[-1]
    assert half.velocity.v == pytest.approx(0.22, abs=0.001)
    waiting = pilot.hold()
    assert (waiting.state, waiting.command) == ("waiting", ZERO_TWIST)
    run = list(drive(pilot, half.pose, 20))
    assert run[-1].progress.state == "finished"
    assert run[1].progress.command is not None
    assert run[1].progress.command.v <= 2 * 0.5 * CONTROL_S


def test_a_robot_that_is_carried_away_takes_the_straight_line_from_there() -> None:
    pilot = WaypointController(WaypointParameters(goals=((2.0, 0.0), (2.0, 2.0))))
    list(drive(pilot, Pose2(0, 0), 5))
    run = list(drive(pilot, Pose2(-1, 3, 2), 60))
    assert reached(run) == [0, 1]
    assert run[-1].progress.distance < 0.01


place = st.floats(-2, 2).map(lambda value: round(value, 2))
heading = st.floats(-3.14, 3.14).map(lambda value: round(value, 2))


def reaches(start: Pose2, goal: tuple[float, float], parameters: WaypointParameters, seconds: float) -> None:
    """Assert that the goal is reached, the limits are kept, and the distance never grows once it drives."""
    run = list(drive(WaypointController(parameters), start, seconds))
    assert run[-1].progress.state == "finished"
    assert math.hypot(run[-1].pose.x - goal[0], run[-1].pose.y - goal[1]) <= parameters.tolerance + 0.001
    nearest = math.inf
    commands = [now.progress.command or ZERO_TWIST for now in run]
    for now, command in zip(run, commands, strict=True):
        distance = math.hypot(now.pose.x - goal[0], now.pose.y - goal[1])
        nearest = min(nearest, distance)
        assert distance < nearest + 0.005
        assert 0 <= command.v <= parameters.max_linear
        assert abs(command.w) <= parameters.max_angular
    for a, b in itertools.pairwise(commands[:-1]):
        assert -parameters.deceleration * CONTROL_S - 1e-9 <= b.v - a.v <= parameters.acceleration * CONTROL_S + 1e-9
        assert abs(b.w - a.w) <= parameters.angular_acceleration * CONTROL_S + 1e-9


@settings(max_examples=40, deadline=None, derandomize=True)
@given(place, place, heading, place, place)
@example(0, 0, math.pi, 1, 0)
@example(0, 0, 0, 0, 0)
@example(0, 0, 3.14, 0.011, 0)
def test_the_steady_law_reaches_any_goal_and_never_drives_away(
    x: float, y: float, yaw: float, goal_x: float, goal_y: float
) -> None:
    reaches(Pose2(x, y, yaw), (goal_x, goal_y), WaypointParameters(goals=((goal_x, goal_y),)), 60)


def bound(*values: float) -> st.SearchStrategy[float]:
    return st.sampled_from(values)


@pytest.mark.slow
@settings(max_examples=16, deadline=None, derandomize=True)
@given(
    max_linear=bound(0.02, 0.22, 2.0),
    max_angular=bound(0.1, 3.0),
    acceleration=bound(0.1, 1.0),
    deceleration=bound(0.1, 1.0),
    angular_acceleration=bound(0.5, 6.0),
    lookahead=bound(0.1, 2.0),
    lag=bound(0.15, 1.0),
    tolerance=bound(0.005, 0.5),
    yaw=heading,
)
def test_every_gain_at_its_bound_is_safe(yaw: float, **gains: float) -> None:
    parameters = msgspec.convert({"goals": ((0.6, 0.8),), **gains}, WaypointParameters)
    reaches(Pose2(0, 0, yaw), (0.6, 0.8), parameters, 200)
