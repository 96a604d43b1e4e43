"""The local planner's loop on the bus, with odometry, scans and the laser's pose."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from messages.base import Float32Array
from messages.geometry import (
    STOP,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from messages.nav import Odometry
from messages.se2 import Pose2, Twist2, wrap
from messages.sensor import LaserScan
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import CMD_VEL, GOAL_POSE, ODOM, PLAN, SCAN, STATUS, TF_STATIC
from services.local_planner import SERVICE, LocalPlannerParameters
from services.runtime.testing import ServiceHarness, run_service

TICK_S = 0.1


class Robot:
    """A robot that obeys at once; each turn publishes odometry and the clock, every second turn also a scan."""

    def __init__(self, bench: ServiceHarness) -> None:
        self.bench, self.pose, self.moving, self.turns = bench, Pose2(), Twist2(), 0
        mount = TransformStamped(
            header=Header(frame_id="tb3_0/base_footprint"),
            child_frame_id="tb3_0/base_scan",
            transform=Transform(translation=Vector3(x=-0.032, z=0.17)),
        )
        bench.publish(TF_STATIC, TFMessage(transforms=(mount,)))

    def turn(self, wall_at: float = math.inf, scans: bool = True) -> Twist:
        stamp = Time.of(round(self.turns * TICK_S * 1e9))
        self.bench.publish(
            ODOM,
            Odometry(
                header=Header(stamp=stamp, frame_id="tb3_0/odom"),
                child_frame_id="tb3_0/base_footprint",
                pose=PoseWithCovariance(pose=self.pose.to_msg()),
                twist=TwistWithCovariance(twist=self.moving.to_msg()),
            ),
        )
        if scans and self.turns % 2 == 0:
            angles = self.pose.yaw + np.arange(360) * math.tau / 360
            facing = np.cos(angles)
            away = np.where(facing > 0.1, (wall_at - self.pose.x + 0.032) / np.maximum(facing, 0.1), math.inf)
            self.bench.publish(
                SCAN,
                LaserScan(
                    header=Header(stamp=stamp, frame_id="tb3_0/base_scan"),
                    angle_increment=math.tau / 360,
                    range_min=0.12,
                    range_max=3.5,
                    ranges=Float32Array(np.maximum(away, 0.0)),
                ),
            )
        self.bench.set_time(self.turns * TICK_S)
        self.turns += 1
        command = self.bench.next(CMD_VEL)
        self.moving = Twist2(command.linear.x, command.angular.z)
        x, y, yaw = self.pose
        step = self.moving.v * TICK_S
        self.pose = Pose2(x + step * math.cos(yaw), y + step * math.sin(yaw), yaw + self.moving.w * TICK_S)
        return command


@pytest.fixture
def robot() -> Iterator[Robot]:
    with run_service(SERVICE, "/tb3_0", LocalPlannerParameters(goals=((0.4, 0.0), (0.4, 0.4)))) as bench:
        yield Robot(bench)


def test_it_drives_its_plan_reports_each_point_and_then_holds_the_robot(robot: Robot) -> None:
    states: list[tuple[str, int]] = []
    for _ in range(300):
        robot.turn()
        states += [(each.state, each.index) for each in robot.bench.drain(STATUS)]
        if states[-1][0] == "finished":
            break
    assert states == [("driving", 0), ("reached", 0), ("driving", 1), ("reached", 1), ("finished", 1)]
    assert math.dist(robot.pose[:2], (0.4, 0.4)) < 0.03
    (plan,) = robot.bench.drain(PLAN)
    assert [(each.pose.position.x, each.pose.position.y) for each in plan.poses] == [(0.4, 0.0), (0.4, 0.4)]
    assert [robot.turn() for _ in range(3)] == [STOP] * 3


def test_without_scans_it_stands_and_says_so(robot: Robot) -> None:
    assert [robot.turn(scans=False) for _ in range(10)] == [STOP] * 10
    assert "no laser scan" in robot.bench.log
    for _ in range(20):
        robot.turn()
    assert robot.pose.x > 0.1
    for _ in range(15):
        robot.turn(scans=False)
    assert robot.moving == Twist2(0.0, 0.0)


def test_it_stops_before_a_wall_and_turns_to_the_heading_of_a_goal_pose(robot: Robot) -> None:
    for _ in range(100):
        robot.turn(wall_at=0.4)
    nose = 0.4 - robot.pose.x
    assert nose > LocalPlannerParameters().radius
    robot.bench.publish(
        GOAL_POSE, PoseStamped(header=Header(frame_id="world"), pose=Pose.planar(*robot.pose[:2], yaw=1.0))
    )
    for _ in range(60):
        robot.turn(wall_at=0.4)
    assert abs(wrap(robot.pose.yaw - 1.0)) < 0.06
    assert [each.state for each in robot.bench.drain(STATUS)][-1] == "finished"


def test_a_goal_in_a_strange_frame_is_refused(robot: Robot) -> None:
    robot.turn()
    robot.bench.publish(GOAL_POSE, PoseStamped(header=Header(frame_id="tb3_1/odom"), pose=Pose.planar(9, 9)))
    robot.turn()
    assert "goal refused" in robot.bench.log
    assert len(robot.bench.drain(PLAN)) == 1
