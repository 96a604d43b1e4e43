"""The tests of ROS's ``diff_drive_controller`` on our base: distances, turns, limits and stops, in real physics.

Its bounds are kept; where theory gives the figure, the bound is narrower.
"""

from __future__ import annotations

import math

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.nav import Odometry
from messages.se3 import Pose3
from messages.topics import CMD_VEL, CMD_VEL_OUT, GROUND_TRUTH, ODOM
from services.runtime.errors import BadInput
from tests.services.sim.drive.simulation_harness import run_simulation

FREE = {"linear": {"max_velocity": 10, "max_acceleration": 1e5}, "angular": {"max_acceleration": 1e5}, "clamp": False}
LIMITED = {
    "linear": {"max_velocity": 1.0, "max_acceleration": 1.0},
    "angular": {"max_velocity": 2.0, "max_acceleration": 2.0},
}
"""The limits in its ``diffbot_limits.yaml``."""


def way(start: Odometry, end: Odometry) -> float:
    a, b = start.pose.pose.position, end.pose.pose.position
    return math.hypot(b.x - a.x, b.y - a.y)


@pytest.mark.slow
@pytest.mark.parametrize("odometry", ["encoder", "world"])
def test_forward_a_metre(odometry: str) -> None:
    with run_simulation(odometry=odometry, **FREE) as world:
        world.drive(0.0, 0.0, 0.1)
        start, real = world.latest(ODOM), world.truth()
        world.drive(0.1, 0.0, 10.0)
        end = world.latest(ODOM)
        elapsed = (end.header.stamp.ns - start.header.stamp.ns) / 1e9
        assert way(start, end) == pytest.approx(0.1 * elapsed, abs=0.01)
        assert way(real, world.truth()) == pytest.approx(1.0, abs=0.005)
        assert end.twist.twist.linear.x == pytest.approx(0.1, rel=0.01)
        assert abs(end.twist.twist.angular.z) < 1e-3


def test_half_a_turn() -> None:
    with run_simulation(**FREE) as world:
        world.drive(0.0, math.pi / 10, 10.0)
        world.run(0.02)
        end = world.latest(ODOM)
        assert abs(end.pose.pose.orientation.yaw) == pytest.approx(math.pi, abs=0.02)
        assert abs(world.truth().pose.pose.orientation.yaw) == pytest.approx(math.pi, abs=0.02)
        assert end.twist.twist.angular.z == pytest.approx(math.pi / 10, rel=0.01)


def test_one_command_and_then_silence_is_less_than_080_metres() -> None:
    with run_simulation(cmd_vel_timeout=0.5, brake=1e5, **FREE) as world:
        world.publish(CMD_VEL, Twist.planar(1.0, 0.0))
        world.run(3.0)
        gone = world.truth().pose.pose.position.x
        assert gone < 0.8
        # A motor of 2 N m takes 0.25 s to 1 m/s and as long to standstill.
        assert gone == pytest.approx(0.5, abs=0.05)


def test_a_timeout_of_zero_never_stops() -> None:
    with run_simulation(cmd_vel_timeout=0.0) as world:
        world.publish(CMD_VEL, Twist.planar(0.5, 0.0))
        world.run(10.0)
        assert world.truth().twist.twist.linear.x == pytest.approx(0.5, rel=1e-3)


def test_acceleration_and_velocity_limits() -> None:
    with run_simulation(publish_cmd=True, **LIMITED) as world:
        world.subscribe(CMD_VEL_OUT)
        world.drive(10.0, 0.0, 0.5)
        assert world.truth().twist.twist.linear.x < 0.5 + 0.02
        for each in world.received(CMD_VEL_OUT):
            assert each.twist.linear.x == pytest.approx(each.header.stamp.ns / 1e9, abs=1e-9), "v = a t"
        world.drive(10.0, 0.0, 4.5)
        assert world.truth().twist.twist.linear.x == pytest.approx(1.0, rel=2e-3)
        assert world.truth().pose.pose.position.x < 5.0
        assert world.latest(CMD_VEL_OUT).twist.linear.x == 1.0
        assert len(world.received(CMD_VEL_OUT)) == 251, "with each control tick of 5 s"


def test_angular_limits() -> None:
    with run_simulation(**LIMITED) as world:
        world.drive(0.0, 10.0, 0.5)
        assert world.truth().twist.twist.angular.z < 1.0 + 0.02
        world.drive(0.0, 10.0, 2.0)
        assert world.truth().twist.twist.angular.z == pytest.approx(2.0, rel=5e-3)


@pytest.mark.parametrize(("rule", "speed"), [("ros2", 0.40), ("ros1", 0.45)])
def test_a_jerk_of_five_gives_037_give_or_take_010(rule: str, speed: float) -> None:
    """Half a second at a_max 1, less a / 2j of the jerk's ramp: 0.1 s / 2 at twice 5, 0.2 s / 2 at 5."""
    limits = {"max_velocity": 1.0, "max_acceleration": 1.0, "max_jerk": 5.0}
    with run_simulation(linear=limits, jerk_rule=rule) as world:
        world.drive(10.0, 0.0, 0.52)
        told = world.truth().twist.twist.linear.x
        assert told == pytest.approx(0.37, abs=0.10 + 0.01)
        assert told == pytest.approx(speed + 0.02, abs=0.01)


BAD = [
    (math.nan, 0.0),
    (0.0, math.nan),
    (math.inf, 0.0),
    (0.0, -math.inf),
    (1e300, 0.0),
    (0.0, -1e13),
    (101.0, 0.0),
    (5e-324, 2.2e-308),
]


@pytest.mark.slow
@pytest.mark.parametrize(("v", "w"), BAD)
def test_bad_commands_never_reach_the_wheels(v: float, w: float) -> None:
    with run_simulation() as world:
        payload = encode({"linear": {"x": v, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": w}})
        world.drive(0.2, 0.0, 2.0)
        before = world.truth().twist.twist.linear.x
        world.publish_raw(CMD_VEL, payload)
        world.run(0.04)
        if (v, w) == BAD[-1]:
            assert world.base.arbiter.decide(world.simulation.now)[:2] == (0.0, 0.0), "it is 0, not denormal"
            return
        assert world.truth().twist.twist.linear.x == pytest.approx(before, abs=1e-3), "the last good one stays"
        world.run(2.0)
        truth = world.truth()
        assert abs(truth.twist.twist.linear.x) < 1e-3
        assert world.status().refused == 1


@pytest.mark.parametrize(
    ("multipliers", "speed", "turn"),
    [
        ({"wheel_radius_multiplier": 1.6}, 1 / 1.6, 1 / 1.6),
        ({"wheel_separation_multiplier": 1.875}, 1.0, 1.875),
        ({"left_wheel_radius_multiplier": 0.9, "right_wheel_radius_multiplier": 0.9}, 1 / 0.9, 1 / 0.9),
    ],
)
def test_multipliers_change_the_wheels_and_the_odometry_believes_them(
    multipliers: dict[str, float], speed: float, turn: float
) -> None:
    with run_simulation(**multipliers) as world:
        world.drive(0.2, 0.0, 2.0)
        assert world.truth().twist.twist.linear.x == pytest.approx(0.2 * speed, rel=5e-3)
        assert world.latest(ODOM).twist.twist.linear.x == pytest.approx(0.2, rel=5e-3)
        world.drive(0.0, 0.5, 2.0)
        assert world.truth().twist.twist.angular.z == pytest.approx(0.5 * turn, rel=5e-3)
        assert world.latest(ODOM).twist.twist.angular.z == pytest.approx(0.5, rel=5e-3)
        assert "WARN /sim: p3dx: wheel radius" in world.log, "they do not fit the URDF"


@pytest.mark.parametrize("wheel", ["left_wheel", "right_wheel"])
def test_a_wheel_that_is_not_there_fails(wheel: str) -> None:
    with (
        pytest.raises(BadInput, match=r"p3dx: .*no wheel joint 'wheel' \(movable: base_left_wheel_joint"),
        run_simulation(**{wheel: "wheel"}),
    ):
        raise AssertionError("it was spawned")


def test_odometry_starts_at_zero_wherever_the_robot_does() -> None:
    half = math.pi / 8
    with run_simulation(at=Pose3((3.0, -2.0, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))) as world:
        world.drive(0.3, 0.3, 3.0)
        told, real = world.latest(ODOM).pose.pose, world.received(GROUND_TRUTH)[-1].pose.pose
        x, y = real.position.x - 3.0, real.position.y + 2.0
        c, s = math.cos(math.pi / 4), math.sin(math.pi / 4)
        assert (told.position.x, told.position.y) == pytest.approx((c * x + s * y, c * y - s * x), abs=1e-3)
        assert told.orientation.yaw == pytest.approx(real.orientation.yaw - math.pi / 4, abs=1e-3)
