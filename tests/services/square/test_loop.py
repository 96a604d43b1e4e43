"""The square service's loop on the bus: it waits, latches, drives, logs, stops, and restarts after a reset."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from messages.geometry import STOP, Pose, PoseWithCovariance, Twist, TwistWithCovariance
from messages.nav import Odometry
from messages.se2 import Pose2, Twist2
from messages.std import Header, Time
from messages.topics import CMD_VEL, GROUND_TRUTH, ODOM, PLAN, STATUS
from services.runtime.testing import ServiceHarness, run_service
from services.square import SERVICE, SquareParameters
from tests.services.square.ideal_base import CONTROL_S, IdealBase

START = Pose2(0.5, -0.25, 0.0)


class SquareLoopHarness:
    """A simulated robot: each turn publishes odometry, ground truth and clock, and obeys the resulting command."""

    def __init__(self, bench: ServiceHarness) -> None:
        self.bench, self.base, self.time, self.epoch = bench, IdealBase(START), 0.0, 0

    def turn(self, odometry: bool = True) -> Twist:
        if odometry:
            here, moving = self.base.pose, self.base.velocity
            self.bench.publish(ODOM, self.sample(here, moving))
            self.bench.publish(GROUND_TRUTH, self.sample(Pose2(9 + here.x, here.y, here.yaw), moving))
        self.bench.set_time(self.time, self.epoch)
        command = self.bench.next(CMD_VEL)
        self.base.run(Twist2(command.linear.x, command.angular.z))
        self.time += CONTROL_S
        return command

    def sample(self, here: Pose2, moving: Twist2) -> Odometry:
        return Odometry(
            header=Header(stamp=Time.of(round(self.time * 1e9))),
            pose=PoseWithCovariance(pose=Pose.planar(here.x, here.y, here.yaw)),
            twist=TwistWithCovariance(twist=Twist.planar(moving.v, moving.w)),
        )

    def states(self) -> list[tuple[str, int]]:
        return [(each.state, each.index) for each in self.bench.drain(STATUS)]

    def until(self, state: str) -> list[tuple[str, int]]:
        seen: list[tuple[str, int]] = []
        for _ in range(2000):
            self.turn()
            seen += self.states()
            if seen and seen[-1][0] == state:
                return seen
        raise AssertionError(f"never {state}: {seen}")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "square.csv"


@pytest.fixture
def rig(log: Path) -> Iterator[SquareLoopHarness]:
    p = SquareParameters(side=0.3, angular_speed=1.5, log=str(log))
    with run_service(SERVICE, "/RosAria", p) as bench:
        yield SquareLoopHarness(bench)


ROUND = [(state, index) for index in range(4) for state in ("driving", "reached")] + [("finished", 3)]


def test_it_drives_its_square_from_where_it_stands_and_then_holds_the_robot(rig: SquareLoopHarness, log: Path) -> None:
    assert rig.until("finished") == ROUND
    (plan,) = rig.bench.drain(PLAN)
    assert plan.header.frame_id == "RosAria/odom"
    corners = [(each.pose.position.x, each.pose.position.y) for each in plan.poses]
    assert corners == [pytest.approx(each) for each in ((0.8, -0.25), (0.8, 0.05), (0.5, 0.05), (0.5, -0.25))]
    assert math.hypot(rig.base.pose.x - START.x, rig.base.pose.y - START.y) < 0.005
    assert [rig.turn() for _ in range(5)] == [STOP] * 5
    assert "square completed" in rig.bench.log
    with log.open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time"]) for row in rows[:3]] == pytest.approx([0, 0.1, 0.2])
    assert max(float(row["error"]) for row in rows) < 0.01
    assert max(float(row["drift"]) for row in rows) < 1e-9
    assert [row["corner"] for row in rows] == sorted(row["corner"] for row in rows)


def test_it_stands_still_until_there_is_odometry_and_says_so(rig: SquareLoopHarness) -> None:
    assert [rig.turn(odometry=False) for _ in range(40)] == [STOP] * 40
    assert "no odometry on /RosAria/odom" in rig.bench.log
    assert rig.bench.drain(PLAN) == []
    rig.base.pose = Pose2(2.0, 2.0, 1.0)
    rig.turn()
    (plan,) = rig.bench.drain(PLAN)
    assert plan.poses[3].pose.position.x == pytest.approx(2.0)


def test_without_odometry_it_stops_and_goes_on_when_it_is_back(rig: SquareLoopHarness) -> None:
    for _ in range(50):
        rig.turn()
    assert rig.base.velocity.v > 0.1
    silent = [rig.turn(odometry=False) for _ in range(60)]
    assert silent[20].linear.x > 0
    assert silent[26:] == [STOP] * 34
    assert rig.states()[-1] == ("waiting", 0)
    assert rig.until("finished")[-1] == ("finished", 3)
    assert math.hypot(rig.base.pose.x - START.x, rig.base.pose.y - START.y) < 0.005


def test_a_reset_begins_anew_from_the_new_place(rig: SquareLoopHarness, log: Path) -> None:
    while ("reached", 0) not in rig.states():
        rig.turn()
    rig.bench.drain(PLAN)
    rig.epoch, rig.time, rig.base = 1, 0.0, IdealBase(Pose2(-1.0, 0.0))
    seen = rig.until("finished")
    assert [each for each in seen if each[0] != "waiting"] == ROUND
    (plan,) = rig.bench.drain(PLAN)
    assert plan.poses[3].pose.position.x == pytest.approx(-1.0)
    times = [float(row["time"]) for row in csv.DictReader(log.open())]
    assert times == sorted(times)


def test_the_last_command_of_a_driver_that_is_stopped_is_stop_and_its_log_is_whole(log: Path) -> None:
    with run_service(SERVICE, "/RosAria", SquareParameters(log=str(log))) as bench:
        rig = SquareLoopHarness(bench)
        for _ in range(60):
            rig.turn()
    assert rig.base.velocity.v > 0.1
    assert bench.drain(CMD_VEL) == [STOP]
    lines = log.read_text().splitlines()
    assert len(lines) == 1 + 12
    assert all(line.count(",") == lines[0].count(",") for line in lines)


def test_without_a_log_it_drives_all_the_same() -> None:
    with run_service(SERVICE, "/RosAria", SquareParameters(side=0.2, angular_speed=1.5, log="")) as bench:
        assert SquareLoopHarness(bench).until("finished")[-1] == ("finished", 3)
