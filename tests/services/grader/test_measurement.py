"""The grader's measurements, on trajectories with known figures."""

from __future__ import annotations

import math
import random
import struct
from hashlib import sha256

import msgspec
import pytest

from messages.elea import BaseStatus, GoalStatus, Health, InputHealth
from messages.geometry import PoseStamped
from messages.nav import Path
from messages.parameters import Parameter, ParameterValues
from services.grader import BrakingSpec
from services.grader.loop import braking_from_parameters
from services.grader.measurement import Measurement, MessageKind
from services.grader.records import RobotFigures
from services.grader.robot import ReferencePath, segment_distance
from services.grader.trajectory import Trail
from tests.services.grader.simulated_run import (
    CORNERS,
    GradedEntry,
    header,
    measure_all,
    odometry_sample,
    robot_messages,
)

FAST = 0.02


def plan(*points: tuple[float, float]) -> Path:
    pose = odometry_sample(0, 0, 0).pose.pose
    return Path(
        header=header(0),
        poses=tuple(
            PoseStamped(pose=msgspec.structs.replace(pose, position=msgspec.structs.replace(pose.position, x=x, y=y)))
            for x, y in points
        ),
    )


def driven(points: list[tuple[float, float]], *goals: tuple[float, float]) -> RobotFigures:
    """Return the figures of a robot that jumps from point to point, one sample each, without a status."""
    corner_messages: list[GradedEntry] = [(MessageKind.PLAN, "a", plan(*goals))] if goals else []
    corner_messages += [
        (MessageKind.TRUTH, "a", odometry_sample(FAST * step, x, y)) for step, (x, y) in enumerate(points)
    ]
    return measure_all(corner_messages, ("a",)).measurements("goals").robots["a"]


def test_distance_to_a_segment_ends_at_its_ends() -> None:
    assert segment_distance((0, 0), (4, 0), 2, 1) == 1
    assert segment_distance((0, 0), (4, 0), 7, 4) == 5
    assert segment_distance((1, 1), (1, 1), 4, 5) == 5


def test_only_the_two_legs_at_the_last_point_count() -> None:
    square = ReferencePath((0, 0), ((2, 0), (2, 2), (0, 2)))
    assert square.cross_track(1, 1.9, 0.0) == 0
    assert square.cross_track(2, 1.0, 0.3) == pytest.approx(1.0)


def test_a_parallel_drive_has_its_offset_as_rms_and_maximum() -> None:
    start = [(0.0, 0.0)]
    figures = driven(start + [(0.01 * step, 0.003) for step in range(1, 100)], (1.0, 0.0))
    assert figures.cross_track_max_m == pytest.approx(0.003)
    assert figures.cross_track_rms_m == pytest.approx(0.003, rel=0.01)


def test_a_sine_about_the_leg_has_its_amplitude_and_its_root_mean_square() -> None:
    wave = [(step * 1e-3, 0.02 * math.sin(2 * math.pi * step / 100)) for step in range(1000)]
    figures = driven(wave, (1.2, 0.0))
    assert figures.cross_track_max_m == pytest.approx(0.02)
    assert figures.cross_track_rms_m == pytest.approx(0.02 / math.sqrt(2), rel=1e-3)


def test_the_way_is_measured_and_points_are_reached_in_turn_only() -> None:
    figures = driven([(0, 0), (0.5, 0), (1, 0), (1, 1), (0, 1)], (1.0, 0.0), (1.0, 1.0), (0.5, 0.0))
    assert figures.path_length_m == pytest.approx(3.5 - 0.5)
    assert figures.points_reached_at == (2 * FAST, 3 * FAST, None)
    assert figures.points_reached == 2
    assert figures.points_closest_m[2] == pytest.approx(math.hypot(0.5, 1.0))
    assert figures.time_s is None


def test_a_robot_without_a_plan_has_no_cross_track() -> None:
    figures = driven([(0, 0), (1, 0)])
    assert (figures.points, figures.cross_track_rms_m, figures.cross_track_max_m) == (0, None, None)
    assert figures.path_length_m == 1


def test_a_claim_to_have_reached_a_point_counts_for_nothing() -> None:
    corner_messages: list[GradedEntry] = [
        (MessageKind.PLAN, "a", plan((1.0, 0.0))),
        (MessageKind.TRUTH, "a", odometry_sample(0, 0, 0)),
    ]
    corner_messages.append(
        (MessageKind.STATUS, "a", GoalStatus(header=header(0.1), state="finished", index=0, count=1))
    )
    corner_messages.append((MessageKind.TRUTH, "a", odometry_sample(0.2, 0.2, 0)))
    run = measure_all(corner_messages, ("a",))
    assert run.finished
    assert run.measurements("goals").robots["a"].points_reached == 0


def test_odometry_is_compared_at_equal_stamps_from_a_common_start() -> None:
    corner_messages: list[GradedEntry] = []
    for step in range(101):
        corner_messages.append((MessageKind.TRUTH, "a", odometry_sample(step * FAST, 3 + 0.01 * step, 4, 0.0)))
        corner_messages.append(
            (MessageKind.ODOMETRY, "a", odometry_sample(step * FAST, 0, -0.0099 * step, -math.pi / 2))
        )
    corner_messages.append((MessageKind.ODOMETRY, "a", odometry_sample(9, 50, 50)))
    figures = measure_all(corner_messages, ("a",)).measurements("goals").robots["a"]
    assert figures.odometry_error_max_m == pytest.approx(0.01)
    assert figures.odometry_error_final_m == pytest.approx(0.01)


def test_world_odometry_has_no_error_at_all() -> None:
    corner_messages = list(robot_messages("a", 0.0))
    assert measure_all(corner_messages, ("a",)).measurements("goals").robots["a"].odometry_error_max_m == 0


def test_distances_between_robots_are_taken_at_one_instant() -> None:
    corner_messages: list[GradedEntry] = []
    for step in range(11):
        corner_messages.append((MessageKind.TRUTH, "a", odometry_sample(step * FAST, 0.1 * step, 0)))
        corner_messages.append((MessageKind.TRUTH, "b", odometry_sample(step * FAST, 1 - 0.1 * step, 0.25)))
        corner_messages.append((MessageKind.TRUTH, "c", odometry_sample(step * FAST + 0.001, 0.1 * step, 0)))
    robots = measure_all(corner_messages, ("a", "b", "c")).measurements("goals").robots
    assert robots["a"].min_distance_m == robots["b"].min_distance_m == pytest.approx(0.25)
    assert robots["c"].min_distance_m is None


def test_losses_are_summed_over_readers_and_survive_a_restart() -> None:
    run = Measurement(("tb3_0", "tb3_1"), 0.05)
    for pid, beat, lost in ((7, 1, 2), (7, 2, 3), (8, 1, 1)):
        inputs = (InputHealth(topic="/tb3_0/odom", lost=lost), InputHealth(topic="/clock", lost=1))
        run.add_heartbeats([Health(node="/logger", pid=pid, beat=beat, inputs=inputs)])
    measured = run.measurements("goals")
    assert measured.messages_lost == 3 + 1 + 1 + 1
    assert measured.robots["tb3_0"].messages_lost == 4
    assert measured.robots["tb3_1"].messages_lost == 0


def test_losses_of_a_robot_in_the_root_namespace_are_those_of_its_own_topics() -> None:
    run = Measurement(("tb3", "b"), 0.05, namespaces={"tb3": "/", "b": "/left/b"})
    topics = {"/odom": 1, "/sonar/range": 2, "/left/b/odom": 4, "/clock": 8, "/supervisor/state": 16}
    inputs = tuple(InputHealth(topic=topic, lost=lost) for topic, lost in topics.items())
    run.add_heartbeats([Health(node="/logger", pid=7, inputs=inputs)])
    measured = run.measurements("goals")
    assert (measured.messages_lost, measured.robots["tb3"].messages_lost, measured.robots["b"].messages_lost) == (
        31,
        3,
        4,
    )


def test_losses_of_those_who_look_on_are_told_apart() -> None:
    run = Measurement(("tb3_0",), 0.05, readers=("/tb3_0/waypoint", "/logger"))
    odometry = InputHealth(topic="/tb3_0/odom", lost=5)
    for node in ("/tb3_0/waypoint", "/panel", "/_topic_echo_12", "/logger"):
        run.add_heartbeats([Health(node=node, pid=1, inputs=(odometry, InputHealth(topic="/clock", lost=2)))])
    run.add_heartbeats([Health(node="/panel", pid=2, inputs=(odometry,)), Health(node="/elsewhere", pid=3)])
    measured = run.measurements("goals")
    assert measured.messages_lost == 7 + 7
    assert measured.robots["tb3_0"].messages_lost == 5 + 5
    assert measured.onlookers_lost == {"/_topic_echo_12": 7, "/panel": 7 + 5}
    by_topic = {"/clock": 2, "/tb3_0/odom": 5}
    assert measured.losses == {"/logger": by_topic, "/tb3_0/waypoint": by_topic}
    run.add_heartbeats(
        [Health(node="/logger", pid=4, inputs=(InputHealth(topic="clock", lost=1), InputHealth(topic="/a")))]
    )
    assert run.measurements("goals").losses["/logger"] == {"/clock": 3, "/tb3_0/odom": 5}, "a restarted one adds to it"


def test_missed_heartbeats_are_no_losses() -> None:
    run = Measurement(("tb3",), 0.05, readers=("/supervisor",), namespaces={"tb3": "/"})
    for node in ("/supervisor", "/panel"):
        beats = InputHealth(topic="/health", lost=7)
        run.add_heartbeats([Health(node=node, pid=1, lost=9, inputs=(beats, InputHealth(topic="/odom", lost=2)))])
        run.add_heartbeats([Health(node=node, pid=1, lost=10, inputs=(beats,))])
        run.add_heartbeats([Health(node=node, pid=2, lost=3, inputs=(InputHealth(topic="/health", lost=3),))])
    measured = run.measurements("goals")
    assert (measured.messages_lost, measured.onlookers_lost) == (3, {"/panel": 3})
    assert measured.losses == {"/supervisor": {"/odom": 2}}
    assert measured.robots["tb3"].messages_lost == 2


def test_how_a_base_stops_follows_its_parameters_in_their_time() -> None:
    def values(**told: float | str | None) -> ParameterValues:
        return ParameterValues(values=tuple(Parameter(name=name, value=value) for name, value in told.items()))

    before, after = BrakingSpec(name="a", timeout=0.25, brake=2.0), BrakingSpec(name="a", timeout=0.5, brake=1.0)
    assert braking_from_parameters("a", values(cmd_vel_timeout=0.5, brake=1.0, jump=0.0)) == after
    for bad in (
        {"cmd_vel_timeout": 0.5},
        {"cmd_vel_timeout": -1.0, "brake": 1.0},
        {"cmd_vel_timeout": "x", "brake": 1},
    ):
        assert braking_from_parameters("a", values(**bad)) is None
    run = Measurement(("a",), 0.05, {"a": before})
    run.set_braking(2 * 10**9, "a", after)
    run.advance(10**9)
    assert run.robots["a"].stops.braking == before
    run.advance(2 * 10**9)
    assert run.robots["a"].stops.braking == after


def test_counts_of_the_base_are_passed_on() -> None:
    base = BaseStatus(header=header(1), collisions=2, commands_timed_out=3, stale_dropped=4, refused=5)
    figures = measure_all([(MessageKind.BASE, "a", base)], ("a",)).measurements("goals").robots["a"]
    assert (figures.collisions, figures.commands_timed_out) == (2, 3)
    assert (figures.stale_dropped, figures.commands_refused) == (4, 5)


NAMES = ("tb3_0", "tb3_1")


@pytest.fixture(scope="module")
def corner_messages() -> list[GradedEntry]:
    return [post for shift, name in enumerate(NAMES) for post in robot_messages(name, 0.5 * shift)]


def test_a_whole_run_reaches_everything_and_finishes(corner_messages: list[GradedEntry]) -> None:
    run = measure_all(corner_messages, NAMES)
    assert run.finished
    for figures in run.measurements("goals").robots.values():
        assert figures.points_reached == figures.points == len(CORNERS)
        assert figures.cross_track_max_m is not None
        assert figures.cross_track_max_m < 0.005
        assert figures.min_distance_m == pytest.approx(0.5, abs=1e-3)
        assert figures.time_s is not None
        assert list(figures.points_reached_at) == sorted(each for each in figures.points_reached_at if each)


def test_nothing_depends_on_the_order_or_the_portions_of_arrival(corner_messages: list[GradedEntry]) -> None:
    whole = measure_all(corner_messages, NAMES).measurements("goals")
    shuffled = list(corner_messages)
    random.Random(7).shuffle(shuffled)
    assert measure_all(shuffled, NAMES).measurements("goals") == whole

    portions = Measurement(NAMES, 0.05)
    by_time = sorted(corner_messages, key=lambda post: post[2].header.stamp.ns)
    for begin in range(0, len(by_time), 97):
        part = by_time[begin : begin + 97]
        for kind, name, message in reversed(part):
            portions.add_messages(kind, name, [message])
        portions.advance(part[-1][2].header.stamp.ns - 200_000_000)
    portions.advance(400_000_000_000)
    assert portions.measurements("goals") == whole


def test_the_hash_is_the_documented_one_and_ends_with_the_run() -> None:
    samples = [odometry_sample(step * FAST, 0.1 * step, -0.2 * step, 0.3 * step) for step in range(5)]
    corner_messages: list[GradedEntry] = [(MessageKind.TRUTH, name, each) for each in samples for name in ("b", "a")]
    packed = b""
    for each in samples[:4]:
        p, q = each.pose.pose.position, each.pose.pose.orientation
        packed += struct.pack("<q7d", each.header.stamp.ns, p.x, p.y, p.z, q.x, q.y, q.z, q.w)
    expected = sha256(b"".join(name + b"\0" + sha256(packed).digest() for name in (b"a", b"b"))).hexdigest()
    assert measure_all(corner_messages, ("b", "a"), end=3 * FAST).measurements("goals").trajectory_hash == expected


def test_the_hash_sees_a_single_bit(corner_messages: list[GradedEntry]) -> None:
    before = measure_all(corner_messages, NAMES).measurements("goals").trajectory_hash
    index = next(
        i for i, post in enumerate(corner_messages) if post[0] is MessageKind.TRUTH and post[2].header.stamp.sec == 5
    )
    kind, name, message = corner_messages[index]
    replace, pose = msgspec.structs.replace, message.pose.pose
    place = replace(pose.position, x=math.nextafter(pose.position.x, 9))
    moved = replace(message, pose=replace(message.pose, pose=replace(pose, position=place)))
    changed = [*corner_messages[:index], (kind, name, moved), *corner_messages[index + 1 :]]
    assert measure_all(changed, NAMES).measurements("goals").trajectory_hash != before


def test_a_trail_stays_short_and_even() -> None:
    trail = Trail(length=8)
    for step in range(1000):
        trail.add((float(step),))
    assert len(trail.rows) <= 8
    assert {b[0] - a[0] for a, b in zip(trail.rows, trail.rows[1:], strict=False)} == {128.0}
