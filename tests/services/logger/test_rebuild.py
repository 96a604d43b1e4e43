"""A recording made from a bag has what the logger would have recorded, including scans, frames and the arm."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from messages.control import JointControllerState
from messages.geometry import Quaternion, Transform, TransformStamped, Vector3
from messages.nav import Odometry
from messages.sensor import JointState
from messages.std import Header, Time
from messages.tf import TFMessage
from services.logger.rebuild import RecordingBuilder
from tests.services.logger.recording_reader import chunks, columns, poses, table
from tests.services.logger.test_scans import MOUNT, MS, scan, truth

ROBOTS = [("/tb3_0", "burger"), ("/arm", "arm")]
EXTENT = (-1.0, -1.0, 1.0, 1.0)


def fill(file: Path, robots: list[tuple[str, str]]) -> None:
    place = Transform(translation=Vector3(x=5.0), rotation=Quaternion.from_yaw(0.0))
    origin = TransformStamped(header=Header(frame_id="world"), child_frame_id="tb3_0/odom", transform=place)
    with RecordingBuilder(file, robots, EXTENT, pytest.fail) as rebuild:
        rebuild.add("/tf_static", TFMessage(transforms=(MOUNT,)), 0)
        rebuild.add("/tf_static", TFMessage(transforms=(origin,)), 0)
        for ms in range(0, 2000, 40):
            rebuild.add("/tb3_0/ground_truth", truth(ms, 5.0 + ms / 1000), ms * MS)
            rebuild.add("/tb3_0/odom", odometry(ms), ms * MS)
            if ms % 200 == 0:
                rebuild.add("/tb3_0/scan", scan(ms, 1.0), ms * MS)
            header = Header(stamp=Time.of(ms * MS))
            joint = JointState(header=header, name=("bear_link",), position=(math.radians(ms / 100),))
            rebuild.add("/arm/joint_states", joint, ms * MS)
            state = JointControllerState(header=header, set_point=ms / 100, process_value=ms / 100, command=2.0)
            rebuild.add("/robot_control/state", state, ms * MS)


def odometry(ms: int) -> Odometry:
    """Return odometry 2 cm ahead of the true position."""
    header = Header(stamp=Time.of(ms * MS), frame_id="tb3_0/odom")
    return Odometry(header=header, pose=truth(ms, ms / 1000 + 0.02).pose)


def test_scans_odometry_and_the_arm_are_where_the_logger_puts_them(tmp_path: Path) -> None:
    file = tmp_path / "bag.rrd"
    fill(file, ROBOTS)
    times, points = columns(file, "/scan/tb3_0", "Points3D:positions")
    assert (times // MS).tolist() == list(range(0, 2000, 200))
    assert points[5] == [pytest.approx((6.1, 2.0, 0.2), abs=1e-6)]
    assert table(file, "/plots/odometry_error")[1] == pytest.approx(np.full((50, 1), 0.02))
    times, angle = table(file, "/plots/angle/arm")
    assert len(times) == 50
    assert angle[-1] == pytest.approx([19.6, 19.6])
    assert table(file, "/plots/effort/arm")[1] == pytest.approx(np.full((50, 1), 2.0))
    assert len(poses(file, "arm", "bear_link")[0]) == 50


def test_of_two_arms_nobody_knows_whose_state_it_is(tmp_path: Path) -> None:
    file = tmp_path / "bag.rrd"
    fill(file, [*ROBOTS, ("/other", "arm")])
    recorded = {chunk.entity_path for chunk in chunks(file) if not chunk.is_static}
    assert {"/arm/tf", "/tb3_0/tf"} <= recorded
    assert not {"/plots/angle/arm", "/plots/angle/other"} & recorded
