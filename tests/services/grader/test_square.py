"""Corners, closure, headings and stops, on trajectories with known figures."""

from __future__ import annotations

import io
import math

import msgspec
import pytest

from deploy.report.record import RunFacts
from deploy.report.table import print_report
from deploy.report.write import build_report
from messages.elea import BaseStatus, GoalStatus
from messages.geometry import Pose, PoseStamped
from messages.nav import Path
from messages.se2 import Pose2
from messages.std import Header, Time
from models.dynamics import predict_stop
from services.grader import BrakingSpec
from services.grader.corners import is_closed
from services.grader.measurement import Measurement, MessageKind
from services.grader.records import RobotFigures
from services.grader.stops import StopMetrics
from tests.services.grader.simulated_run import GradedEntry, header, measure_all, odometry_sample

SQUARE = (Pose2(1, 0, math.pi / 2), Pose2(1, 1, math.pi), Pose2(0, 1, -math.pi / 2), Pose2(0, 0, 0))
AWAY, TURNED = (3.0, -2.0), math.pi / 2
"""Position [m] and yaw [rad] of the odometry frame in the world."""


def plan(goals: tuple[Pose2, ...], frame: str = "a/odom") -> Path:
    poses = tuple(PoseStamped(pose=Pose.planar(each.x, each.y, each.yaw)) for each in goals)
    return Path(header=Header(frame_id=frame), poses=poses)


def world(pose: Pose2) -> Pose2:
    """Transform a pose from the odometry frame to the world."""
    return Pose2(AWAY[0] - pose.y, AWAY[1] + pose.x, pose.yaw + TURNED)


def driven(off: Pose2, drift: Pose2) -> RobotFigures:
    """Return the figures of a robot that reports the next corner each second, with a true error ``off`` and an odometry
    error ``drift``.

    Odometry and ground truth have frames of their own.
    """
    posts: list[GradedEntry] = [(MessageKind.PLAN, "a", plan(SQUARE))]
    way = [Pose2(0.0, 0.0), *(Pose2(each.x + off.x, each.y + off.y, each.yaw + off.yaw) for each in SQUARE)]
    for second, true in enumerate(way):
        seen = Pose2(true.x + drift.x, true.y, true.yaw + drift.yaw) if second else true
        there = world(true)
        posts.append((MessageKind.TRUTH, "a", odometry_sample(second, there.x, there.y, there.yaw)))
        posts.append((MessageKind.ODOMETRY, "a", odometry_sample(second, seen.x, seen.y, seen.yaw)))
        if second:
            posts.append(
                (MessageKind.STATUS, "a", GoalStatus(header=header(second), state="reached", index=second - 1))
            )
    posts.append((MessageKind.STATUS, "a", GoalStatus(header=header(4), state="finished", index=3)))
    return measure_all(posts, ("a",)).measurements("goals").robots["a"]


def test_a_way_is_closed_when_each_corner_asks_for_the_heading_of_the_next_leg() -> None:
    assert is_closed(SQUARE)
    assert is_closed(SQUARE * 3)
    assert not is_closed(SQUARE[:3])
    assert not is_closed(tuple(Pose2(each.x, each.y) for each in SQUARE))
    assert not is_closed(())
    assert not is_closed((Pose2(1, 0), Pose2(1, 0), Pose2(1, 0)))


def test_corners_are_measured_truly_and_by_odometry_in_frames_of_their_own() -> None:
    figures = driven(Pose2(0.03, 0.04, 0.02), Pose2(0.01, 0.0, -0.01))
    assert [each.at_s for each in figures.corners if each] == [1, 2, 3, 4]
    for corner in figures.corners:
        assert corner is not None
        assert corner.true_m == pytest.approx(0.05)
        assert corner.true_deg == pytest.approx(math.degrees(0.02))
        assert corner.odometry_m == pytest.approx(math.hypot(0.04, 0.04))
        assert corner.odometry_deg == pytest.approx(math.degrees(0.01))
    assert figures.closure_m == pytest.approx(0.05)
    assert figures.closure_heading_deg == pytest.approx(math.degrees(0.02))
    assert figures.closure_odometry_m == pytest.approx(math.hypot(0.04, 0.04))
    assert figures.closure_odometry_heading_deg == pytest.approx(math.degrees(0.01))
    assert figures.odometry_error_max_m == pytest.approx(0.01)
    assert figures.odometry_heading_error_max_deg == pytest.approx(math.degrees(0.01))
    assert figures.odometry_heading_error_final_deg == pytest.approx(math.degrees(0.01))


def test_a_plan_in_the_frame_of_odometry_is_judged_in_the_world() -> None:
    figures = driven(Pose2(0.0, 0.0), Pose2(0.0, 0.0))
    assert (figures.points, figures.points_reached) == (4, 4)
    assert figures.cross_track_max_m == pytest.approx(0.0, abs=1e-12)


def test_a_corner_that_was_not_reached_is_null_and_an_open_way_has_no_corners() -> None:
    posts: list[GradedEntry] = [(MessageKind.PLAN, "a", plan(SQUARE))]
    posts += [(MessageKind.TRUTH, "a", odometry_sample(each, 0.5 * each, 0)) for each in range(3)]
    posts += [(MessageKind.ODOMETRY, "a", odometry_sample(each, 0.5 * each, 0)) for each in range(3)]
    posts.append((MessageKind.STATUS, "a", GoalStatus(header=header(2), state="reached", index=0)))
    figures = measure_all(posts, ("a",)).measurements("stopped").robots["a"]
    assert [each is None for each in figures.corners] == [False, True, True, True]
    assert (figures.closure_m, figures.closure_odometry_heading_deg) == (None, None)
    posts[0] = (MessageKind.PLAN, "a", plan(SQUARE[:2]))
    assert measure_all(posts, ("a",)).measurements("stopped").robots["a"].corners == ()


class Brake:
    """A base whose commands cease at ``last`` [s]: ground truth at ``rate`` [Hz], the base's status at 5 Hz."""

    def __init__(self, speed: float, last: float, timeout: float, brake: float, rate: float = 50.0) -> None:
        self.speed, self.last, self.timeout, self.brake, self.rate = speed, last, timeout, brake, rate

    def state(self, time: float) -> tuple[float, float]:
        """Return distance driven [m] and speed [m/s] at a time [s]."""
        since = time - self.last - self.timeout
        if since <= 0:
            return self.speed * time, self.speed
        moving = min(since, self.speed / self.brake)
        way = self.speed * (self.last + self.timeout) + self.speed * moving - self.brake * moving**2 / 2
        return way, self.speed - self.brake * moving

    def feed(self, stops: StopMetrics, end: float = 6.0) -> None:
        for tick in range(round(end * self.rate)):
            time = tick / self.rate
            stops.add_sample(round(time * 1e9), *self.state(time))
            if tick % round(self.rate / 5) == 0:
                silent = time > self.last + self.timeout
                last = self.last if silent else min(time, self.last)
                stops.add_status(
                    BaseStatus(
                        last_command=Time.of(round(last * 1e9)), timed_out=silent, commands_timed_out=int(silent)
                    )
                )


@pytest.mark.parametrize("speed", [0.2, 0.5, 0.75])
@pytest.mark.parametrize("rate", [25.0, 50.0])
def test_a_stop_is_measured_from_the_last_command_and_compared_with_the_theory(speed: float, rate: float) -> None:
    stops = StopMetrics(BrakingSpec(name="a", timeout=0.25, brake=1.5))
    Brake(speed, 2.013, 0.25, 1.5, rate).feed(stops)
    assert stops.count == 1
    theory = predict_stop(speed, 0.25, 1.5)
    hardest = stops.longest
    assert hardest.speed == pytest.approx(speed)
    assert (hardest.theory_time, hardest.theory_distance) == pytest.approx(theory)
    assert hardest.distance == pytest.approx(theory.distance, rel=0.01)
    assert hardest.time == pytest.approx(theory.time, rel=0.05)


def test_without_the_figures_of_the_base_or_a_time_out_there_is_no_theory() -> None:
    for stops in (StopMetrics(), StopMetrics(BrakingSpec(name="a", timeout=0.0, brake=0.3))):
        Brake(0.5, 2.0, 0.25, 0.3).feed(stops)
        assert stops.longest.distance == pytest.approx(0.5 * 0.25 + 0.25 / 0.6, rel=0.01)
        assert (stops.longest.theory_time, stops.longest.theory_distance) == (None, None)


def test_lost_samples_make_no_stop_of_less_than_nothing() -> None:
    """Samples just before the last command are lost: by then the robot was slower than in the last sample."""
    stops = StopMetrics()
    for seconds, length, speed in ((1.0, 0.0, 0.5), (3.0, 0.6, 0.3), (3.2, 0.65, 0.0)):
        stops.add_sample(round(seconds * 1e9), length, speed)
    stops.add_status(BaseStatus(last_command=Time.of(2_900_000_000), timed_out=True, commands_timed_out=1))
    assert stops.count == 1
    assert stops.longest.distance == pytest.approx(0.65 - 0.6 * 1.9 / 2.0)


def test_a_commander_that_returns_before_rest_is_no_stop() -> None:
    stops = StopMetrics(BrakingSpec(name="a", timeout=0.25, brake=0.3))
    brake = Brake(0.75, 1.0, 0.25, 0.3)
    brake.feed(stops, end=2.0)
    stops.add_status(BaseStatus(last_command=Time.of(2_000_000_000), commands_timed_out=1))
    for tick in range(100, 400):
        stops.add_sample(tick * 20_000_000, *brake.state(tick / 50))
    assert (stops.count, stops.longest.distance) == (0, None)


def test_a_base_that_stood_makes_no_stop_and_costs_nothing_more() -> None:
    stops = StopMetrics()
    for tick in range(100):
        stops.add_sample(tick * 20_000_000, 1.0, 0.0)
    stops.add_status(BaseStatus(last_command=Time.of(1_000_000_000), timed_out=True, commands_timed_out=1))
    stops.add_sample(2_000_000_000, 1.0, 0.0)
    assert (stops.count, stops.longest.distance) == (0, None)


def test_the_longest_of_two_stops_is_told() -> None:
    stops, other = StopMetrics(BrakingSpec(name="a", timeout=0.25, brake=1.5)), Brake(0.5, 1.0, 0.25, 1.5)
    other.feed(stops)
    first = stops.longest
    for tick in range(300, 320):
        stops.add_sample(tick * 20_000_000, 10.0 + 0.001 * tick, 0.05)
    stops.add_status(BaseStatus(last_command=Time.of(6_200_000_000), timed_out=True, commands_timed_out=2))
    stops.add_sample(6_420_000_000, 10.4, 0.0)
    assert stops.count == 2
    assert stops.longest == first


def test_the_grader_passes_its_knowledge_of_the_bases_on() -> None:
    run = Measurement(("a", "b"), 0.05, {"a": BrakingSpec(name="a", timeout=0.25, brake=1.5)})
    brake = Brake(0.5, 1.0, 0.25, 1.5)
    for tick in range(200):
        time = tick / 50
        run.add_messages(
            MessageKind.TRUTH, "a", [odometry_sample(time, brake.state(time)[0], 0, v=brake.state(time)[1])]
        )
    base = BaseStatus(
        header=header(3), last_command=Time.of(1_000_000_000), timed_out=True, commands=9, commands_timed_out=1
    )
    run.add_messages(MessageKind.BASE, "a", [base])
    run.advance(4_000_000_000)
    figures = run.measurements("goals").robots["a"]
    assert (figures.stops, figures.commands_timed_out) == (1, 1)
    assert figures.stop_distance_m == pytest.approx(figures.stop_distance_theory_m, rel=0.01)
    assert run.measurements("goals").robots["b"].stop_distance_m is None


NOTE = "It is off by design."
FACTS = RunFacts(fleet="square", mode="lockstep", seed=1, version="0", wall_seconds=1.0, notes=(NOTE,))


def shown(figures: RobotFigures) -> str:
    run = Measurement(("a",), 0.05).measurements("goals")
    out = io.StringIO()
    print_report(build_report(msgspec.structs.replace(run, robots={"a": figures}), FACTS, {"closure_m": 0.02}), out)
    return out.getvalue()


def test_the_table_tells_corners_closure_notes_and_a_missed_bound() -> None:
    text = shown(driven(Pose2(0.03, 0.04, 0.02), Pose2(0.01, 0.0, -0.01)))
    assert "a: off its corners by 50.0 50.0 50.0 50.0 mm, in heading +1.15 +1.15 +1.15 +1.15 deg" in text
    assert "a: closed to 50.0 mm and 1.15 deg; by odometry 56.6 mm and 0.57 deg" in text
    assert "It is off by design." in text
    assert "missed: a.closure_m is 0.05, should be at most 0.02" in text


def test_of_many_corners_the_table_tells_the_worst() -> None:
    figures = driven(Pose2(0.03, 0.04, 0.02), Pose2(0.0, 0.0))
    text = shown(msgspec.structs.replace(figures, corners=figures.corners * 3))
    assert "a: off its 12 corners by at most 50.0 mm, 1.15 deg" in text


def test_the_table_tells_a_stop_beside_its_theory() -> None:
    figures = msgspec.structs.replace(
        driven(Pose2(0, 0), Pose2(0, 0)),
        stops=2,
        stop_speed=0.5,
        stop_time_s=0.59,
        stop_distance_m=0.21,
        stop_time_theory_s=0.583,
        stop_distance_theory_m=0.2083,
    )
    told = "a: left without a command 2 times; from 0.50 m/s to rest in 0.59 s and 210 mm (theory 0.58 s, 208 mm)"
    assert told in shown(figures)
    untimed = msgspec.structs.replace(figures, stop_time_theory_s=None, stop_distance_theory_m=None)
    assert "to rest in 0.59 s and 210 mm\n" in shown(untimed)
