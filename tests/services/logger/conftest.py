"""A recording of four robots driving for a minute, made once for all tests that read it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from messages.geometry import Twist
from messages.nav import Odometry
from messages.rosgraph import WARN, Log
from messages.std import Header, Time
from services.logger.columns import RobotColumns
from services.logger.recording import Recording
from tests.services.logger.synthetic_drive import step_all, synthetic_fleet

EXTENT = (-0.5, -4.5, 5.5, 4.5)
LENGTH_S = 60.0
BATCH = 50


@dataclass
class RecordedDrive:
    """The recording file and the data recorded in it."""

    file: Path
    truth: dict[str, list[Odometry]] = field(default_factory=dict)
    commands: dict[str, list[float]] = field(default_factory=dict)
    left_wheel: dict[str, list[float]] = field(default_factory=dict)


@pytest.fixture(scope="session")
def driven(tmp_path_factory: pytest.TempPathFactory) -> RecordedDrive:
    made = RecordedDrive(tmp_path_factory.mktemp("logger") / "run.rrd")
    robots = synthetic_fleet()
    columns = {name: RobotColumns() for name in robots}
    for name, robot in robots.items():
        made.truth[name], made.commands[name], made.left_wheel[name] = [], [], []
        columns[name].add_plan(robot.plan())
        columns[name].add_status(robot.status())
    with Recording(made.file, [(name, "burger") for name in robots], EXTENT, pytest.fail) as recording:
        for count, now in enumerate(step_all(robots, LENGTH_S), start=1):
            for name, robot in robots.items():
                columns[name].add_truth([robot.truth()])
                columns[name].add_odometry([robot.odometry()])
                columns[name].add_joints([robot.joints()])
                columns[name].add_commands([Twist.planar(robot.wanted, 0.0)], now, 0.02)
                columns[name].add_status(robot.status())
                made.truth[name].append(robot.truth())
                made.commands[name].append(robot.wanted)
                made.left_wheel[name].append(robot.left)
            if count % BATCH == 0:
                recording.write({name: each.flush() for name, each in columns.items()})
                said = Log(header=Header(stamp=Time.of(now)), level=WARN, name="/tb3_1/waypoint", msg=f"batch {count}")
                recording.write_log([said])
        recording.write({name: each.flush() for name, each in columns.items()}, last=True)
    return made
