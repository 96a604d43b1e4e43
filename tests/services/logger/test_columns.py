"""The mathematics between messages and columns: courses, trails, alignment, tables and bounded buffers."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.elea import GoalStatus
from messages.geometry import (
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
)
from messages.nav import Odometry, Path
from messages.se2 import Pose2
from messages.sensor import JointState
from messages.std import Header, Time
from services.logger.columns import RobotColumns, RowBuffer, Trail
from services.logger.recording import FleetSeries
from services.logger.reference_path import ReferencePath, distance_to_segments
from services.markers.footprint import transform_points
from services.runtime.tf.buffer import TransformBuffer

COORDINATE = st.floats(-100, 100)
ANGLE = st.floats(-math.pi, math.pi)
MS = 1_000_000


def odometry(ms: int, x: float, y: float = 0.0, yaw: float = 0.0, frame: str = "") -> Odometry:
    pose = PoseWithCovariance(pose=Pose.planar(x, y, yaw))
    return Odometry(header=Header(stamp=Time.of(ms * MS), frame_id=frame), pose=pose)


def path(ms: int, *goals: tuple[float, float], frame: str = "world") -> Path:
    poses = tuple(PoseStamped(pose=Pose.planar(x, y)) for x, y in goals)
    return Path(header=Header(stamp=Time.of(ms * MS), frame_id=frame), poses=poses)


def status(ms: int, index: int, count: int = 2, state: Any = "driving") -> GoalStatus:
    return GoalStatus(header=Header(stamp=Time.of(ms * MS)), state=state, index=index, count=count)


def test_distance_to_a_segment_beside_it_and_beyond_its_ends() -> None:
    points = np.array([(1.0, 0.5), (-3.0, 4.0), (5.0, 0.0), (2.0, 2.0)])
    begins = np.array([(0.0, 0.0)] * 3 + [(1.0, 1.0)])
    ends = np.array([(2.0, 0.0)] * 3 + [(1.0, 1.0)])
    assert distance_to_segments(points, begins, ends) == pytest.approx([0.5, 5.0, 3.0, math.sqrt(2)])


def test_a_course_follows_the_legs_and_closes_the_lap() -> None:
    course = ReferencePath(10, np.array([0.0, 0.0]), np.array([(1.0, 0.0), (1.0, 1.0)]))
    course.set_goal(10, 0)
    course.set_goal(20, 1)
    course.set_goal(30, 0)
    times = np.array([5, 15, 25, 35])
    cross, distance = course.errors(times, np.array([(0.0, 0.0), (0.5, 0.1), (0.8, 0.5), (1.2, 0.5)]))
    assert np.isnan([cross[0], distance[0]]).all()
    assert cross[1:] == pytest.approx([0.1, 0.2, 0.2])
    assert distance[1:] == pytest.approx([math.hypot(0.5, 0.1), math.hypot(0.2, 0.5), math.hypot(0.2, 0.5)])


def test_a_course_forgets_only_what_is_past() -> None:
    course = ReferencePath(0, np.zeros(2), np.array([(1.0, 0.0), (1.0, 1.0)]))
    course.set_goal(20, 1)
    course.trim(25)
    cross, _ = course.errors(np.array([25, 30]), np.array([(0.0, 0.5), (1.0, 0.2)]))
    assert cross == pytest.approx([1.0, 0.0])


@given(COORDINATE, COORDINATE, ANGLE, COORDINATE, COORDINATE, ANGLE)
def test_an_alignment_lays_odometry_over_truth(
    x: float, y: float, yaw: float, ox: float, oy: float, oyaw: float
) -> None:
    found = Pose2.aligning(Pose2(x, y, yaw), Pose2(ox, oy, oyaw))
    assert transform_points(found, np.array([(ox, oy)]))[0] == pytest.approx((x, y), abs=1e-9)
    ahead = np.array([(ox + math.cos(oyaw), oy + math.sin(oyaw))])
    assert transform_points(found, ahead)[0] == pytest.approx((x + math.cos(yaw), y + math.sin(yaw)), abs=1e-9)


@given(st.lists(st.integers(1, 40), min_size=1, max_size=12))
def test_a_trail_is_the_same_chain_however_it_is_batched(sizes: list[int]) -> None:
    count = sum(sizes)
    bend = np.linspace(0.0, 3.0, count)
    positions = np.column_stack((np.cos(bend), np.sin(bend), np.zeros(count)))
    trail, begun, segments = Trail(spacing=0.05), 0, []
    for size in sizes:
        times, part = trail.extend(np.arange(begun, begun + size), positions[begun : begun + size])
        assert len(times) == len(part)
        segments += list(part)
        begun += size
    for before, after in itertools.pairwise(segments):
        assert (before[1] == after[0]).all()
    last = segments[-1][1] if segments else positions[0]
    assert np.linalg.norm(positions[-1] - last) <= 0.05 + 3.0 / max(1, count - 1)


def test_a_resting_robot_leaves_no_trail() -> None:
    times, segments = Trail().extend(np.arange(500), np.zeros((500, 3)))
    assert (len(times), len(segments)) == (0, 0)


def test_a_table_waits_for_the_slower_robot_and_gives_each_time_once() -> None:
    table = FleetSeries(2, 1)
    table.add(0, np.array([10, 20, 30]) * MS, np.array([[1.0], [2.0], [3.0]]))
    table.add(1, np.array([10, 20]) * MS, np.array([[5.0], [6.0]]))
    times, values = table.drain()
    assert times.tolist() == [10 * MS, 20 * MS]
    assert values[:, :, 0].tolist() == [[1.0, 5.0], [2.0, 6.0]]
    table.add(1, np.array([30]) * MS, np.array([[7.0]]))
    times, values = table.drain()
    assert (times.tolist(), values[:, :, 0].tolist()) == ([30 * MS], [[3.0, 7.0]])
    assert len(table.drain()[0]) == 0


def test_a_slower_topic_holds_its_value_and_a_silent_robot_holds_nobody_up() -> None:
    table = FleetSeries(2, 1)
    table.add(0, np.arange(0, 1000, 20) * MS, np.ones((50, 1)))
    table.add(1, np.array([0, 100]) * MS, np.array([[5.0], [6.0]]))
    times, values = table.drain()
    assert times[-1] == 980 * MS
    other = dict(zip(times // MS, values[:, 1, 0], strict=True))
    assert (other[80], other[100], other[600]) == (5.0, 6.0, 6.0)
    assert math.isnan(other[620])


def test_a_full_buffer_drops_the_oldest_and_counts() -> None:
    buffer = RowBuffer(2, limit=100)
    for batch in range(30):
        buffer.extend([(batch * 10 + i, 0.0) for i in range(10)])
    assert buffer.dropped == 200
    assert buffer.drain()[:, 0].tolist() == list(range(200, 300))
    assert len(buffer.drain()) == 0


def test_what_nobody_flushes_stays_bounded() -> None:
    robot = RobotColumns(limit=100)
    for ms in range(0, 20_000, 20):
        robot.add_truth([odometry(ms, 0.0)])
        robot.add_odometry([odometry(ms, 0.0)])
        robot.add_commands([Twist()], ms * MS, 0.02)
        robot.add_joints([JointState(name=("a",), position=(1.0,))])
    assert robot.dropped == 4 * 900
    assert len(robot.flush().times) == 100


def test_encoder_odometry_is_compared_from_where_it_began() -> None:
    robot = RobotColumns()
    robot.add_truth([odometry(0, 3.0, 1.0, math.pi / 2), odometry(20, 3.0, 1.5, math.pi / 2)])
    robot.add_odometry([odometry(0, 0.0, 0.0, 0.0), odometry(20, 0.4, 0.0, 0.0)])
    assert robot.flush().odometry_error[:, 0] == pytest.approx([0.0, 0.1])


def test_odometry_waits_for_its_truth() -> None:
    robot = RobotColumns()
    robot.add_odometry([odometry(0, 0.0), odometry(20, 1.0)])
    robot.add_truth([odometry(0, 0.0)])
    assert robot.flush().odometry_times.tolist() == [0]
    robot.add_truth([odometry(40, 4.0)])
    batch = robot.flush()
    assert batch.odometry_times.tolist() == [20 * MS]
    assert batch.odometry_error[:, 0] == pytest.approx([1.0]), "the truth between two samples is interpolated"


def test_a_plan_in_the_odometry_frame_is_drawn_in_the_world() -> None:
    robot = RobotColumns()
    robot.add_plan(path(0, (1.0, 0.0), frame="tb3_0/odom"))
    robot.add_status(status(0, 0, count=1))
    robot.add_truth([odometry(0, 2.0, 2.0, math.pi / 2)])
    assert robot.flush().plan is None, "not before it is known where that frame lies"
    robot.add_odometry([odometry(20, 0.0)])
    robot.add_truth([odometry(20, 2.0, 2.0, math.pi / 2)])
    batch = robot.flush()
    assert batch.plan is not None
    assert batch.plan[:, :2].tolist() == [pytest.approx((2.0, 2.0)), pytest.approx((2.0, 3.0))]
    assert batch.scalars[:, 3] == pytest.approx([1.0])


def test_odometry_lies_where_tf_static_says_and_leaves_a_trail_there() -> None:
    """Aligned with the first true pose, it would hide its initial error."""
    frames = TransformBuffer()
    place = Transform(translation=Vector3(x=2.0, y=2.0), rotation=Quaternion.from_yaw(math.pi / 2))
    header = Header(frame_id="world")
    frames.add_static([TransformStamped(header=header, child_frame_id="tb3_0/odom", transform=place)], b"sim")
    robot = RobotColumns(frames=frames)
    robot.add_plan(path(0, (1.0, 0.0), frame="tb3_0/odom"))
    robot.add_truth([odometry(0, 2.0, 2.1), odometry(20, 2.0, 2.6)])
    robot.add_odometry([odometry(0, 0.0, frame="tb3_0/odom"), odometry(20, 0.5, frame="tb3_0/odom")])
    batch = robot.flush()
    assert batch.odometry_error[:, 0] == pytest.approx([0.1, 0.1])
    assert batch.odometry_trail_times.tolist() == [20 * MS]
    assert batch.odometry_trail[0, :, :2].tolist() == [pytest.approx((2.0, 2.0)), pytest.approx((2.0, 2.5))]
    assert batch.plan is not None
    assert batch.plan[1, :2] == pytest.approx((2.0, 3.0))


def test_the_goal_is_told_when_it_changes_and_none_after_the_last() -> None:
    robot = RobotColumns()
    robot.add_plan(path(0, (1.0, 0.0), (1.0, 2.0)))
    robot.add_truth([odometry(0, 0.0)])
    for at, index, state in ((0, 0, "driving"), (100, 0, "driving"), (200, 1, "driving"), (300, 1, "finished")):
        robot.add_status(status(at, index, state=state))
    batch = robot.flush()
    assert (batch.goal_times // MS).tolist() == [0, 200, 300]
    assert batch.goals[:2].tolist() == [[1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]
    assert np.isnan(batch.goals[2]).all()
    assert len(robot.flush().goals) == 0


def test_the_same_goals_again_begin_nothing() -> None:
    robot = RobotColumns()
    robot.add_plan(path(0, (1.0, 0.0)))
    robot.add_truth([odometry(0, 0.0)])
    assert robot.flush().plan is not None
    robot.add_plan(path(500, (1.0, 0.0)))
    robot.add_truth([odometry(500, 0.5)])
    assert robot.flush().plan is None
    robot.add_plan(path(900, (1.0, 2.0)))
    robot.add_truth([odometry(900, 0.9)])
    plan = robot.flush().plan
    assert plan is not None
    assert plan[:, :2].tolist() == [[0.9, 0.0], [1.0, 2.0]]


def test_commands_without_stamps_are_spread_over_their_tick_and_held() -> None:
    robot = RobotColumns()
    robot.add_commands([Twist.planar(v, 0.0) for v in (0.1, 0.2)], 200 * MS, 0.2)
    robot.add_truth([odometry(ms, 0.0) for ms in (80, 100, 180, 200, 240)])
    commanded = robot.flush().scalars[:, 1]
    assert math.isnan(commanded[0])
    assert commanded[1:] == pytest.approx([0.1, 0.1, 0.2, 0.2])
    robot.add_truth([odometry(400, 0.0)])
    assert robot.flush().scalars[0, 1] == pytest.approx(0.2)
