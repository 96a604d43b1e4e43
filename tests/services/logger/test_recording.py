"""Recorded rows, times and values, read back with rerun's own reader."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from messages.geometry import Pose, PoseWithCovariance
from messages.nav import Odometry
from messages.std import Header, Time
from models import MODELS, urdf_path
from models.urdf import parse_urdf
from services.logger.columns import RobotColumns
from services.logger.recording import Recording
from services.logger.reference_path import distance_to_segments
from services.logger.scene import joint_transforms
from services.runtime.errors import BadInput
from tests.models import sample_robots
from tests.services.logger.conftest import EXTENT, LENGTH_S, RecordedDrive
from tests.services.logger.recording_reader import columns, entities, poses, table
from tests.services.logger.synthetic_drive import X, Y

ROWS = round(LENGTH_S * 50)
ROBOTS = tuple(f"tb3_{k}" for k in range(4))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_every_pose_is_there_at_its_time(driven: RecordedDrive, robot: str) -> None:
    times, found = poses(driven.file, robot, "base_footprint")
    truth = driven.truth[robot]
    assert times.tolist() == [each.header.stamp.ns for each in truth]
    wanted = [(each.pose.pose.position.x, each.pose.pose.position.y, each.pose.pose.orientation.yaw) for each in truth]
    turns = found[:, 3:]
    yaw = 2 * np.arctan2(turns[:, 2], turns[:, 3])
    assert np.allclose(found[:, :2], np.array(wanted)[:, :2], atol=1e-6)
    assert np.allclose(np.cos(yaw - np.array(wanted)[:, 2]), 1.0, atol=1e-6)


@pytest.mark.slow
def test_wheels_stand_on_their_axles_and_turn(driven: RecordedDrive) -> None:
    times, found = poses(driven.file, "tb3_2", "wheel_left_link")
    assert len(times) == ROWS
    assert np.allclose(found[:, :3], (0.0, 0.08, 0.023), atol=1e-6)
    half = np.array(driven.left_wheel["tb3_2"]) / 2
    assert np.allclose(found[:, 4] * np.cos(half), found[:, 6] * np.sin(half), atol=1e-5)


def test_plots_hold_a_column_for_each_robot(driven: RecordedDrive) -> None:
    times, speed = table(driven.file, "/plots/speed")
    assert times.tolist() == [each.header.stamp.ns for each in driven.truth["tb3_0"]]
    for column, robot in enumerate(ROBOTS):
        assert np.allclose(speed[:, column], [each.twist.twist.linear.x for each in driven.truth[robot]])
    times, commanded = table(driven.file, "/plots/commanded")
    assert np.allclose(commanded[:, 3], driven.commands["tb3_3"])


def test_cross_track_and_distance_are_those_of_the_leg(driven: RecordedDrive) -> None:
    times, cross = table(driven.file, "/plots/cross_track")
    _, distance = table(driven.file, "/plots/distance")
    first_leg = times < 15 * 10**9
    for column, robot in enumerate(ROBOTS):
        y0 = 0.5 * column
        here = np.array([(t.pose.pose.position.x, t.pose.pose.position.y) for t in driven.truth[robot]])[first_leg]
        goal = np.array([X[0], Y[0] + y0])
        start = np.tile([0.0, y0], (len(here), 1))
        wanted = distance_to_segments(here, start, np.tile(goal, (len(here), 1)))
        assert np.allclose(cross[first_leg, column], wanted, atol=1e-4)
        assert np.allclose(distance[first_leg, column], np.linalg.norm(here - goal, axis=1))
    assert 0.001 < np.nanmax(cross) < 0.1


def test_odometry_error_is_the_drift(driven: RecordedDrive) -> None:
    _, error = table(driven.file, "/plots/odometry_error")
    travelled = [sum(t.twist.twist.linear.x * 0.02 for t in driven.truth[robot]) for robot in ROBOTS]
    assert np.allclose(error[-1], [0.001 * (k + 1) * way for k, way in enumerate(travelled)], rtol=0.02)


def test_a_trail_is_as_long_as_the_way(driven: RecordedDrive) -> None:
    times, strips = columns(driven.file, "/trails/tb3_1", "LineStrips3D:strips")
    segments = np.array(strips)[:, 0]
    assert np.allclose(segments[1:, 0], segments[:-1, 1]), "each segment begins where the last one ended"
    way = sum(each.twist.twist.linear.x * 0.02 for each in driven.truth["tb3_1"])
    assert np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum() == pytest.approx(way, abs=0.05)
    assert len(times) < ROWS / 3


def test_the_reference_path_goes_from_the_start_through_the_goals(driven: RecordedDrive) -> None:
    times, strips = columns(driven.file, "/reference/tb3_3", "LineStrips3D:strips")
    assert times.tolist() == [0]
    assert np.allclose(np.array(strips[0][0])[1:, :2], np.column_stack((X, np.array(Y) + 1.5)), atol=1e-6)
    assert np.allclose(strips[0][0][0], (0.0, 1.5, 0.0), atol=1e-3)


def test_the_log_stands_under_its_node(driven: RecordedDrive) -> None:
    times, text = columns(driven.file, "/log/tb3_1/waypoint", "TextLog:text")
    _, level = columns(driven.file, "/log/tb3_1/waypoint", "TextLog:level")
    assert times.tolist() == [second * 10**9 for second in range(1, 61)]
    assert text[0] == ["tb3_1/waypoint: batch 50"]
    assert level[0] == ["WARN"]


def test_bodies_are_there(driven: RecordedDrive) -> None:
    drawn = set(entities(driven.file))
    for robot in ROBOTS:
        assert f"/{robot}/burger/visual_geometries/base_link/visual_0" in drawn


def test_after_a_reset_time_begins_anew_on_a_timeline_of_its_own(tmp_path: Path) -> None:
    robot = RobotColumns()
    with Recording(tmp_path / "run.rrd", [("tb3_0", "burger")], EXTENT, pytest.fail) as recording:
        robot.add_truth([pose(1.0, 5.0), pose(1.1, 5.1)])
        recording.write({"tb3_0": robot.flush()}, last=True)
        recording.restart()
        robot.clear()
        robot.add_truth([pose(0.0, 0.0), pose(0.1, 0.1)])
        recording.write({"tb3_0": robot.flush()}, last=True)
    times, found = poses(tmp_path / "run.rrd", "tb3_0", "base_footprint")
    assert (times.tolist(), found[:, 0].tolist()) == ([1_000_000_000, 1_100_000_000], pytest.approx([5.0, 5.1]))
    times, found = poses(tmp_path / "run.rrd", "tb3_0", "base_footprint", "sim_time_2")
    assert (times.tolist(), found[:, 0].tolist()) == ([0, 100_000_000], pytest.approx([0.0, 0.1]))
    _, strips = columns(tmp_path / "run.rrd", "/trails/tb3_0", "LineStrips3D:strips", "sim_time_2")
    assert np.array(strips)[:, 0].max() == pytest.approx(0.1), "the trail does not reach back before the reset"


def test_frames_without_a_prefix(tmp_path: Path) -> None:
    robot = RobotColumns()
    with Recording(
        tmp_path / "run.rrd", [("tb3_0", "burger")], EXTENT, pytest.fail, prefixes={"tb3_0": ""}
    ) as recording:
        robot.add_truth([pose(1.0, 5.0)])
        recording.write({"tb3_0": robot.flush()}, last=True)
    _, frames = columns(tmp_path / "run.rrd", "/tb3_0/tf", "Transform3D:child_frame")
    assert frames == [["base_footprint"]]
    assert "/tb3_0/burger/visual_geometries/base_link/visual_0" in set(entities(tmp_path / "run.rrd"))


def test_an_unknown_model_names_the_known_ones(tmp_path: Path) -> None:
    with (
        pytest.raises(BadInput, match=r"burgr.*burger.*waffle"),
        Recording(tmp_path / "run.rrd", [("tb3_0", "burgr")], EXTENT, pytest.fail),
    ):
        pass


@pytest.mark.parametrize("model", MODELS)
def test_every_model_can_be_drawn(tmp_path: Path, model: str) -> None:
    with Recording(tmp_path / "run.rrd", [("r", model)], EXTENT, pytest.fail):
        pass
    drawn = [each for each in entities(tmp_path / "run.rrd") if each.startswith(f"/r/{model}/visual_geometries/")]
    assert len(drawn) == urdf_path(model).read_text().count("<visual>")


def pose(seconds: float, x: float) -> Odometry:
    return Odometry(
        header=Header(stamp=Time.of(round(seconds * 1e9))),
        pose=PoseWithCovariance(pose=Pose.planar(x, 0.0, math.pi / 2)),
    )


def test_joints_slide_and_turn_as_the_urdf_says() -> None:
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    urdf = sample_robots.robot(
        sample_robots.link("a"),
        sample_robots.link("b"),
        sample_robots.link("c"),
        sample_robots.joint(
            "slide", "prismatic", "a", "b", '<origin xyz="1 2 3" rpy="0 0 0.5"/><axis xyz="0 0.6 0.8"/>', limit
        ),
        sample_robots.joint(
            "turn", "revolute", "b", "c", '<origin xyz="1 2 3" rpy="0.1 0.2 0.5"/><axis xyz="0 0.6 0.8"/>', limit
        ),
    )
    for each in parse_urdf(urdf).joints:
        places, turns = joint_transforms(each, np.array([0.0, 0.3, -0.2]))
        for number, position in enumerate((0.0, 0.3, -0.2)):
            assert tuple(places[number]) == pytest.approx(each.transform(position).position)
            assert tuple(turns[number]) == pytest.approx(each.transform(position).orientation)
