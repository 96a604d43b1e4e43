"""Incoming commands: stamps, several publishers, and the limits and wheel settings of a fleet file."""

from __future__ import annotations

import pytest

from messages.geometry import Twist, TwistStamped
from messages.std import Header, Time
from messages.topics import CMD_VEL, CMD_VEL_OUT, CMD_VEL_STAMPED
from tests.services.sim.drive.simulation_harness import SimulationHarness, run_simulation


def stamped(seconds: float, v: float) -> TwistStamped:
    return TwistStamped(header=Header(stamp=Time.of(round(seconds * 1e9))), twist=Twist.planar(v, 0.0))


def speed(world: SimulationHarness) -> float:
    return world.truth().twist.twist.linear.x


def test_a_stamped_command_is_as_old_as_its_stamp() -> None:
    with run_simulation(use_stamped_vel=True) as world:
        for _ in range(50):
            world.publish(CMD_VEL_STAMPED, stamped(world.now, 0.2))
            world.run(0.04)
        assert speed(world) == pytest.approx(0.2, rel=5e-3)
        world.publish(CMD_VEL_STAMPED, stamped(world.now - 0.2, 0.2))
        world.run(0.04)
        assert not world.base.arbiter.timed_out
        world.run(0.04)
        assert world.base.arbiter.timed_out, "0.2 s old when it came, it lasts for 0.05 s more"


@pytest.mark.parametrize("late", [-0.3, 0.05, 1e9])
def test_a_stamp_too_old_or_from_the_future_is_refused_with_a_word(late: float) -> None:
    with run_simulation(use_stamped_vel=True) as world:
        world.run(1.0)
        world.publish(CMD_VEL_STAMPED, stamped(world.now + late, 0.2))
        world.run(0.5)
        assert speed(world) == pytest.approx(0.0, abs=1e-6)
        assert world.status().stale_dropped == 1
        assert (
            "is dropped: it is older than the time-out of 0.25 s, or in the future. Does its publisher use /clock?"
            in world.log
        )


def test_a_stamp_of_zero_counts_from_its_arrival_and_is_told_once() -> None:
    with run_simulation(use_stamped_vel=True) as world:
        world.run(1.0)
        for _ in range(50):
            world.publish(CMD_VEL_STAMPED, stamped(0.0, 0.2))
            world.run(0.04)
        assert speed(world) == pytest.approx(0.2, rel=5e-3)
        assert world.log.count("has no stamp") == 1


def test_a_twist_is_refused_where_a_stamped_one_is_read() -> None:
    with run_simulation(use_stamped_vel=True) as world:
        world.drive(0.2, 0.0, 0.4)
        assert speed(world) == pytest.approx(0.0, abs=1e-6)
        assert world.status().refused == 10


def test_several_publishers_are_too_many_where_one_is_allowed() -> None:
    with run_simulation(allow_multiple_cmd_vel_publishers=False) as world:
        world.drive(0.3, 0.0, 2.0)
        for _ in range(25):
            world.publish(CMD_VEL, Twist.planar(0.3, 0.0), "/controller")
            world.publish(CMD_VEL, Twist.planar(0.1, 0.0), "/other")
            world.run(0.04)
        assert speed(world) == pytest.approx(0.0, abs=1e-3), "it brakes"
        assert world.status().refused == 50 - 1, "all but the first, which came alone"
        assert "allow_multiple_cmd_vel_publishers is false" in world.log
        world.drive(0.3, 0.0, 2.0)
        assert speed(world) == pytest.approx(0.3, rel=5e-3), "one alone is left"


def test_by_default_the_last_of_several_is_obeyed() -> None:
    with run_simulation() as world:
        for _ in range(50):
            world.publish(CMD_VEL, Twist.planar(0.3, 0.0), "/controller")
            world.publish(CMD_VEL, Twist.planar(0.1, 0.0), "/other")
            world.run(0.04)
        assert speed(world) in (pytest.approx(0.1, rel=5e-3), pytest.approx(0.3, rel=5e-3))
        assert world.status().refused == 0


@pytest.mark.parametrize("model", ["burger", "p3dx"])
def test_cmd_vel_out_is_what_the_wheels_are_told(model: str) -> None:
    with run_simulation(model, publish_cmd=True) as world:
        world.subscribe(CMD_VEL_OUT)
        world.drive(0.2, 0.4, 3.0)
        out = world.latest(CMD_VEL_OUT)
        assert out.header.frame_id == "p3dx/base_footprint"
        assert out.header.stamp.ns == world.received(CMD_VEL_OUT)[-2].header.stamp.ns + 20_000_000
        assert (out.twist.linear.x, out.twist.angular.z) == pytest.approx((0.2, 0.4))
        speeds = [each.twist.linear.x for each in world.received(CMD_VEL_OUT)]
        assert speeds == sorted(speeds)
        truth = world.truth().twist.twist
        assert (truth.linear.x, truth.angular.z) == pytest.approx((0.2, 0.4), rel=5e-3)


def test_a_burger_may_have_limits_of_its_own() -> None:
    with run_simulation("burger", linear={"max_velocity": 0.1, "max_acceleration": 0.05}) as world:
        world.drive(0.2, 0.0, 1.0)
        assert speed(world) == pytest.approx(0.05, abs=2e-3)
        world.drive(0.2, 0.0, 2.0)
        assert speed(world) == pytest.approx(0.1, rel=5e-3)


def test_wheels_driven_by_torque_follow_as_well() -> None:
    with run_simulation(wheel_pid={"p": 5, "i": 0.1, "d": 0.01}) as world:
        assert "i has no effect while i_clamp is 0" in world.log
        world.drive(0.5, 0.0, 4.0)
        assert speed(world) == pytest.approx(0.5, rel=0.01)
        world.drive(0.0, 1.0, 4.0)
        assert world.truth().twist.twist.angular.z == pytest.approx(1.0, rel=0.02)
        world.run(3.0)
        assert speed(world) == pytest.approx(0.0, abs=1e-3)


def test_a_torque_beyond_the_motor_s_is_clamped() -> None:
    """2 N m on each of two wheels of radius 0.0975 m accelerate 9 kg by at most 4.6 m/s2, whatever the PID demands."""
    limits = {"max_velocity": 5.0, "max_acceleration": 1000.0}
    with run_simulation(wheel_pid={"p": 1e4}, linear=limits) as world:
        world.drive(1.0, 0.0, 0.1)
        assert 0.2 < speed(world) < 2 * 2.0 / 0.0975 / 9.0 * 0.12
