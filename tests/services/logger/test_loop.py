"""The logger's loop on the bus: it records all messages up to the last, and starts a new timeline at a reset."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from messages.geometry import Twist
from messages.rosgraph import Log
from messages.std import Header, Time
from messages.topics import CMD_VEL, GROUND_TRUTH, JOINT_STATES, ODOM, PLAN, ROSOUT, STATUS
from services.logger import SERVICE, LoggerParameters
from services.logger.loop import pair_models
from services.logger.viewer import should_open
from services.runtime.errors import BadInput
from services.runtime.testing import ServiceHarness, run_service
from tests.harness.ports import free_port
from tests.services.logger.recording_reader import columns, poses, table
from tests.services.logger.synthetic_drive import SyntheticRobot


def drive(bench: ServiceHarness, robot: SyntheticRobot, until: float, epoch: int = 0) -> None:
    """Publish a robot's messages and the clock, sample by sample, up to ``until`` [s]."""
    while robot.time < round(until * 1e9):
        robot.step()
        bench.publish(GROUND_TRUTH.of("tb3_0"), robot.truth())
        bench.publish(ODOM.of("tb3_0"), robot.odometry())
        bench.publish(JOINT_STATES.of("tb3_0"), robot.joints())
        bench.publish(CMD_VEL.of("tb3_0"), Twist.planar(robot.wanted, 0.0))
    bench.set_time(robot.time / 1e9, epoch)


def settings(file: Path, port: int) -> LoggerParameters:
    return LoggerParameters(robots=("/tb3_0",), file=str(file), port=port, view="never", window=0.02)


def test_it_records_all_that_came_until_it_was_stopped(tmp_path: Path) -> None:
    robot = SyntheticRobot(y0=0.0)
    with run_service(SERVICE, "/", settings(tmp_path / "run.rrd", free_port())) as bench:
        bench.set_time(0.0)
        bench.publish(PLAN.of("tb3_0"), robot.plan())
        bench.publish(STATUS.of("tb3_0"), robot.status())
        for end in np.arange(0.2, 6.1, 0.2):
            drive(bench, robot, end)
        said = Log(header=Header(stamp=Time.of(6_000_000_000)), name="/tb3_0/waypoint", msg="there")
        bench.publish(ROSOUT, said)
    times, _ = poses(tmp_path / "run.rrd", "tb3_0", "base_footprint")
    assert times.tolist() == [20_000_000 * k for k in range(1, 301)]
    times, cross = table(tmp_path / "run.rrd", "/plots/cross_track")
    assert len(times) == 300
    assert (cross < 0.1).all()
    _, text = columns(tmp_path / "run.rrd", "/log/tb3_0/waypoint", "TextLog:text")
    assert text == [["tb3_0/waypoint: there"]]
    assert "recording to" in bench.log


def test_a_reset_begins_a_new_timeline(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    with run_service(SERVICE, "/", settings(file, free_port())) as bench:
        bench.set_time(0.0)
        drive_until_written(bench, SyntheticRobot(y0=0.0), file, "sim_time")
        bench.set_time(0.0, epoch=1)
        again = SyntheticRobot(y0=0.5)
        drive_until_written(bench, again, file, "sim_time_2", epoch=1)
    times, found = poses(file, "tb3_0", "base_footprint", "sim_time_2")
    assert times[-1] == again.time
    assert np.abs(found[:, 1] - 0.5).max() < 0.2
    _, before = poses(file, "tb3_0", "base_footprint", "sim_time")
    assert np.abs(before[:, 1]).max() < 0.2


def drive_until_written(
    bench: ServiceHarness, robot: SyntheticRobot, file: Path, timeline: str, epoch: int = 0
) -> None:
    """Drive until the first batch is in the file: messages published during a reset aren't recorded.

    The file is written by a thread of the recording, which may wait for a processor.
    """
    for _ in range(100):
        drive(bench, robot, robot.time / 1e9 + 0.2, epoch)
        end = time.monotonic() + 0.1
        while not is_written(file, timeline):
            if time.monotonic() > end:
                break
        else:
            return
    raise AssertionError("nothing was written")


def is_written(file: Path, timeline: str) -> bool:
    """Return whether the file has poses of a timeline; reading fails while a message is half written."""
    try:
        return len(poses(file, "tb3_0", "base_footprint", timeline)[0]) > 0
    except RuntimeError:
        return False


def test_one_model_stands_for_all_and_wrong_counts_are_refused() -> None:
    assert pair_models(("a", "/b"), ("burger",)) == [("a", "burger"), ("b", "burger")]
    assert pair_models(("a", "b"), ("burger", "waffle")) == [("a", "burger"), ("b", "waffle")]
    assert pair_models((), ("burger",)) == []
    with pytest.raises(BadInput, match="2 models for 3 robots"):
        pair_models(("a", "b", "c"), ("burger", "waffle"))
    with pytest.raises(BadInput, match="twice"):
        pair_models(("a", "/a"), ("burger",))


def test_a_viewer_opens_where_there_is_a_display() -> None:
    assert should_open("auto", {"DISPLAY": ":0"})
    assert should_open("auto", {"WAYLAND_DISPLAY": "wayland-0"})
    assert not should_open("auto", {"DISPLAY": ""})
    assert not should_open("never", {"DISPLAY": ":0"})
    assert should_open("always", {})
