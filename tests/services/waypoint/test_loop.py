"""The waypoint service's loop on the bus: commands, plan, status, new goals, lost odometry and resets."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from messages.geometry import STOP, Pose, PoseStamped, PoseWithCovariance, Twist, TwistWithCovariance
from messages.nav import Odometry
from messages.se2 import Pose2, Twist2, wrap
from messages.std import Header, Time
from messages.topics import CMD_VEL, GOAL_POSE, ODOM, PLAN, STATUS
from services.runtime.testing import ServiceHarness, run_service
from services.waypoint import SERVICE, WaypointParameters
from tests.services.waypoint.ideal_base import CONTROL_S, IdealBase


class WaypointLoopHarness:
    """A simulated robot: each turn publishes odometry and clock, and obeys the resulting command."""

    def __init__(self, bench: ServiceHarness) -> None:
        self.bench, self.base, self.time = bench, IdealBase(Pose2(0, 0)), 0.0
        self.epoch = 0

    def turn(self, odometry: bool = True) -> Twist:
        if odometry:
            here, moving = self.base.pose, self.base.velocity
            self.bench.publish(
                ODOM,
                Odometry(
                    header=Header(stamp=Time.of(round(self.time * 1e9)), frame_id="tb3_0/odom"),
                    pose=PoseWithCovariance(pose=Pose.planar(here.x, here.y, here.yaw)),
                    twist=TwistWithCovariance(twist=Twist.planar(moving.v, moving.w)),
                ),
            )
        self.bench.set_time(self.time, self.epoch)
        command = self.bench.next(CMD_VEL)
        self.base.run(Twist2(command.linear.x, command.angular.z))
        self.time += CONTROL_S
        return command

    def states(self) -> list[tuple[str, int]]:
        return [(each.state, each.index) for each in self.bench.drain(STATUS)]

    def until(self, state: str) -> list[tuple[str, int]]:
        seen: list[tuple[str, int]] = []
        for _ in range(1000):
            self.turn()
            seen += self.states()
            if seen and seen[-1][0] == state:
                return seen
        raise AssertionError(f"never {state}: {seen}")


@pytest.fixture
def rig() -> Iterator[WaypointLoopHarness]:
    with run_service(SERVICE, "/tb3_0", WaypointParameters(goals=((0.3, 0.0), (0.3, 0.2)))) as bench:
        yield WaypointLoopHarness(bench)


def test_it_drives_its_list_reports_each_point_and_then_holds_the_robot(rig: WaypointLoopHarness) -> None:
    assert rig.until("finished") == [
        ("driving", 0),
        ("reached", 0),
        ("driving", 1),
        ("reached", 1),
        ("finished", 1),
    ]
    lines = [line.partition("/tb3_0/waypoint: ") for line in rig.bench.log.splitlines()]
    assert [told for head, _, told in lines if head.endswith("DEBUG ")] == [
        "driving, point 1 of 2, (0.3, 0)",
        "reached, point 1 of 2, (0.3, 0)",
        "driving, point 2 of 2, (0.3, 0.2)",
        "reached, point 2 of 2, (0.3, 0.2)",
        "finished, point 2 of 2, (0.3, 0.2)",
    ]
    (plan,) = rig.bench.drain(PLAN)
    assert plan.header.frame_id == "tb3_0/odom"
    assert [(each.pose.position.x, each.pose.position.y) for each in plan.poses] == [(0.3, 0.0), (0.3, 0.2)]
    assert [rig.turn() for _ in range(5)] == [STOP] * 5
    assert rig.states() == []


def test_a_goal_pose_replaces_the_plan_and_one_in_a_strange_frame_is_refused(rig: WaypointLoopHarness) -> None:
    for _ in range(10):
        rig.turn()
    strange = PoseStamped(header=Header(frame_id="tb3_1/base_scan"), pose=Pose.planar(9, 9))
    rig.bench.publish(GOAL_POSE, strange)
    rig.turn()
    assert "goal refused" in rig.bench.log
    assert len(rig.bench.drain(PLAN)) == 1
    goal = PoseStamped(header=Header(frame_id="world"), pose=Pose.planar(0.2, -0.2, 2.0))
    rig.bench.publish(GOAL_POSE, goal)
    assert rig.until("finished")[-3:] == [("driving", 0), ("reached", 0), ("finished", 0)]
    assert len(rig.bench.drain(PLAN)) == 1
    assert (rig.base.pose.x, rig.base.pose.y) == pytest.approx((0.2, -0.2), abs=0.01)
    assert wrap(rig.base.pose.yaw - 2.0) == pytest.approx(0, abs=0.02)


def test_without_odometry_it_stops_says_so_and_goes_on_when_it_is_back(rig: WaypointLoopHarness) -> None:
    for _ in range(20):
        rig.turn()
    assert rig.base.velocity.v > 0.1
    silent = [rig.turn(odometry=False) for _ in range(30)]
    assert silent[11].linear.x > 0
    assert silent[12:] == [STOP] * 18
    assert rig.states()[-1] == ("waiting", 0)
    assert "no odometry" in rig.bench.log
    assert rig.until("finished")[0] == ("driving", 0)


def test_a_reset_begins_the_plan_anew(rig: WaypointLoopHarness) -> None:
    while ("reached", 0) not in rig.states():
        rig.turn()
    rig.bench.drain(PLAN)
    rig.epoch, rig.time, rig.base = 1, 0.0, IdealBase(Pose2(0, 0))
    assert rig.until("finished") == [
        ("waiting", 0),
        ("driving", 0),
        ("reached", 0),
        ("driving", 1),
        ("reached", 1),
        ("finished", 1),
    ]
    assert len(rig.bench.drain(PLAN)) == 1


def test_the_last_command_of_a_driver_that_is_stopped_is_stop() -> None:
    with run_service(SERVICE, "/tb3_0", WaypointParameters(goals=((5.0, 0.0),))) as bench:
        rig = WaypointLoopHarness(bench)
        for _ in range(30):
            rig.turn()
    assert rig.base.velocity.v > 0.1
    assert bench.drain(CMD_VEL) == [STOP]
