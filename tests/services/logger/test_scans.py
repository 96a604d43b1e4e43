"""Laser scans as points: their positions in the world and in the recording; not computed unless requested."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from messages.base import Float32Array
from messages.geometry import Pose, PoseWithCovariance, Quaternion, Transform, TransformStamped, Vector3
from messages.nav import Odometry
from messages.sensor import LaserScan
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import GROUND_TRUTH, SCAN, TF, TF_STATIC
from services.logger import SERVICE, LoggerParameters
from services.logger.columns import RobotColumns
from services.logger.scans import ScanBuffer
from services.markers.displays import scan_points
from services.runtime.testing import run_service
from services.runtime.tf.buffer import TransformBuffer
from tests.services.logger.recording_reader import columns, entities

BASE, LASER = "tb3_0/base_footprint", "tb3_0/base_scan"
MS = 1_000_000
MOUNT = TransformStamped(
    header=Header(frame_id=BASE),
    child_frame_id=LASER,
    transform=Transform(translation=Vector3(x=0.1, z=0.2), rotation=Quaternion.from_yaw(math.pi / 2)),
)
"""A laser ahead of the robot's centre that faces left."""


def scan(ms: int, *ranges: float) -> LaserScan:
    """Return a scan with rays ahead, to the left, behind and to the right of the laser."""
    return LaserScan(
        header=Header(stamp=Time.of(ms * MS), frame_id=LASER),
        angle_increment=math.pi / 2,
        range_min=0.1,
        range_max=3.5,
        ranges=Float32Array(ranges),
    )


def truth(ms: int, x: float, yaw: float = 0.0) -> Odometry:
    return Odometry(
        header=Header(stamp=Time.of(ms * MS), frame_id="world"),
        child_frame_id=BASE,
        pose=PoseWithCovariance(pose=Pose.planar(x, 1.0, yaw)),
    )


@pytest.fixture
def frames() -> TransformBuffer:
    known = TransformBuffer()
    known.add_static([MOUNT], b"sim")
    return known


def test_rays_without_an_echo_are_no_points() -> None:
    found = scan_points(scan(0, 1.0, math.inf, -math.inf, 0.05))
    assert found == pytest.approx(np.array([[1.0, 0.0, 0.0]]))
    assert scan_points(scan(0, 3.6, math.nan)).shape == (0, 3)


def test_points_lie_where_the_robot_stood_and_its_laser_is_mounted(frames: TransformBuffer) -> None:
    robot = RobotColumns(frames=frames)
    robot.add_scans([scan(0, 1.0, 2.0), scan(20, 1.0)])
    robot.add_truth([truth(0, 5.0), truth(40, 5.2, math.pi / 2)])
    batch = robot.flush()
    assert (batch.scan_times // MS).tolist() == [0, 20]
    assert batch.scans[0] == pytest.approx(np.array([[5.1, 2.0, 0.2], [3.1, 1.0, 0.2]]), abs=1e-6)
    half = math.sqrt(0.5)
    wanted = [5.1 + 0.1 * half - half, 1.0 + 0.1 * half + half, 0.2]
    assert batch.scans[1][0] == pytest.approx(wanted, abs=1e-6), "between two true poses, half way"


def test_a_scan_waits_for_its_pose_and_is_given_once(frames: TransformBuffer) -> None:
    robot = RobotColumns(frames=frames)
    robot.add_scans([scan(0, 1.0), scan(200, 1.0)])
    robot.add_truth([truth(0, 0.0)])
    assert robot.flush().scan_times.tolist() == [0]
    robot.add_truth([truth(240, 0.24)])
    batch = robot.flush()
    assert batch.scan_times.tolist() == [200 * MS]
    assert batch.scans[0][0, 0] == pytest.approx(0.3)
    assert robot.flush().scans == []


def test_what_cannot_be_placed_is_left_out_and_what_waits_is_bounded(frames: TransformBuffer) -> None:
    row = np.array([[100 * MS, 0, 0, 0, 0, 0, 0, 1.0, 0]])
    early = ScanBuffer(frames)
    early.add([scan(0, 1.0)])
    assert early.to_world(BASE, row)[1] == []
    unmounted = ScanBuffer(TransformBuffer())
    unmounted.add([scan(100, 1.0)])
    assert unmounted.to_world(BASE, row)[1] == []
    full = ScanBuffer(frames, limit=10)
    full.add([scan(ms, 1.0) for ms in range(25)])
    assert full.dropped == 15
    assert len(full.to_world(BASE, np.vstack((row * 0, row)))[1]) == 10


@pytest.mark.parametrize("scans", [True, False])
def test_the_service_records_them_if_asked(tmp_path: Path, scans: bool) -> None:
    """The simulation doesn't compute topics that the logger doesn't read: /tf, and scans unless requested."""
    file = tmp_path / "run.rrd"
    settings = LoggerParameters(
        robots=("tb3_0", "arm"),
        models=("burger", "arm"),
        file=str(file),
        serve=False,
        view="never",
        window=0.02,
        scans=scans,
    )
    with run_service(SERVICE, "/", settings) as bench:
        bench.publish(TF_STATIC, TFMessage(transforms=(MOUNT,)))
        bench.publish(TF, TFMessage())
        bench.publish(SCAN.of("arm"), scan(0))
        bench.set_time(0.0)
        for ms in range(0, 1000, 40):
            bench.publish(GROUND_TRUTH.of("tb3_0"), truth(ms, ms / 1000))
            if ms % 200 == 0:
                bench.publish(SCAN.of("tb3_0"), scan(ms, 1.0, 2.0) if ms else scan(ms, math.inf))
        bench.set_time(1.0)
        assert bench.reads(TF_STATIC)
        assert bench.reads(SCAN.of("tb3_0")) == scans
        assert not bench.reads(TF)
        assert not bench.reads(SCAN.of("arm")), "a robot without a laser"
    if not scans:
        times, _ = columns(file, "/scan/tb3_0", "Points3D:positions")
        assert len(times) == 0
        return
    times, points = columns(file, "/scan/tb3_0", "Points3D:positions")
    assert (times // MS).tolist() == [0, 200, 400, 600, 800]
    assert points[0] == [], "no echo, no point: the last ones do not stay"
    assert points[1] == [pytest.approx((0.3, 2.0, 0.2), abs=1e-6), pytest.approx((-1.7, 1.0, 0.2), abs=1e-6)]
    assert "/scan/tb3_0" in set(entities(file))
