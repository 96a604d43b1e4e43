"""Parameters of a base while it drives: immediate changes, rejected ones, and the owner of the values."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from messages.base import unpack36
from messages.requests import DELETE, SET_DRIVE, Name
from messages.simulation import DriveSettings
from messages.topics import ODOM
from services.runtime.errors import CallFailed
from services.runtime.parameters import subscription
from tests.harness.fake_parameter_service import FakeParameterService
from tests.harness.waiting import wait_until
from tests.services.sim.drive.simulation_harness import NAME, SimulationHarness, run_simulation

SET = f"/{NAME}/base"


@contextmanager
def tuned(**parameters: Any) -> Iterator[tuple[SimulationHarness, FakeParameterService]]:
    """Run a robot whose parameter set a fake parameter service owns."""
    with run_simulation(**parameters) as world, FakeParameterService(world.bus) as params:
        wait_until(lambda: world.node.spin_once() or params.announcements)
        yield world, params


def tell(world: SimulationHarness, params: FakeParameterService, **values: Any) -> None:
    params.publish(SET, {name.replace("__", "."): value for name, value in values.items()})
    world.run(0.02)


def test_the_set_is_told_with_the_figures_of_its_model_and_fleet() -> None:
    with tuned(brake=2.0, linear={"max_velocity": 0.5}) as (_, params):
        (asked,) = params.announcements
        described = {each.name: each for each in asked.parameters}
        assert (asked.set, asked.node) == (SET, "/sim")
        assert {each.name: each.value for each in asked.fleet} == {"brake": 2.0, "linear.max_velocity": 0.5}
        assert described["brake"].default == 1.5
        assert described["wheel_radius"].default == 0.0975
        assert described["linear.max_acceleration"].default == 0.3
        assert not any(described[each].live for each in ("wheel_radius", "left_wheel", "odometry", "open_loop", "ramp"))
        assert all(described[each].live for each in ("brake", "cmd_vel_timeout", "publish_rate", "linear.max_jerk"))


def test_what_this_very_robot_cannot_change_is_described_so_and_refused_before_it_counts() -> None:
    with tuned(ramp="wheels") as (_, params):
        described = {each.name: each for each in params.announcements[0].parameters}
        assert not any(described[each].live for each in ("wheel_pid.p", "wheel_pid.i", "brake_angular"))
    with tuned(wheel_pid={"p": 1.0}, ramp="base") as (_, params):
        described = {each.name: each for each in params.announcements[0].parameters}
        assert all(described[each].live for each in ("wheel_pid.p", "wheel_pid.i", "brake_angular"))
        assert not described["wheel_pid.p"].optional, "null would take the torque away"
        assert described["pose_covariance_diagonal"].longest == (6,)
        assert "linear.max_jerk" in described["keep_curvature"].excludes


def test_limits_time_out_and_brake_change_while_it_drives() -> None:
    with tuned() as (world, params):
        world.drive(0.4, 0.0, 2.0)
        assert world.base.commanded_velocity[0] == pytest.approx(0.4)
        tell(world, params, linear__max_velocity=0.2, cmd_vel_timeout=1.0, brake=0.5)
        world.drive(0.4, 0.0, 0.4)
        assert world.base.commanded_velocity[0] == pytest.approx(0.2)
        world.run(0.9)
        assert not world.base.arbiter.timed_out
        world.run(0.14)
        assert world.base.arbiter.timed_out
        before = world.base.commanded_velocity[0]
        world.run(0.1)
        assert before - world.base.commanded_velocity[0] == pytest.approx(0.05, abs=1e-9)


def test_a_shorter_time_out_counts_for_the_command_that_is_there() -> None:
    with tuned(cmd_vel_timeout=10) as (world, params):
        world.drive(0.2, 0.0, 1.0)
        world.run(1.0)
        assert world.base.commanded_velocity[0] == pytest.approx(0.2)
        tell(world, params, cmd_vel_timeout=0.25)
        assert world.base.arbiter.timed_out


def test_what_odometry_tells_changes_its_source_does_not() -> None:
    with tuned() as (world, params):
        world.run(0.2)
        tell(
            world,
            params,
            pose_covariance_diagonal=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
            publish_rate=10.0,
            velocity_rolling_window_size=5,
            odometry="world",
        )
        world.received(ODOM).clear()
        world.run(1.0)
        told = world.received(ODOM)
        assert len(told) == 10
        assert unpack36(told[-1].pose.packed)[::7] == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
        settings = world.robot.publishers.odometer.config
        assert (settings.source, settings.window) == ("encoder", 5)


def test_gains_change_but_a_wheel_is_not_switched_to_torque() -> None:
    with tuned(wheel_pid={"p": 1.0}) as (world, params):
        tell(world, params, wheel_pid__p=3.0, wheel_pid__i_clamp=0.5)
        gains = world.base.config.gains
        assert gains is not None
        assert (gains.p, gains.i_max) == (3.0, 0.5)
        tell(world, params, wheel_pid__p=None)
        assert world.base.config.gains is gains
        wait_until(lambda: world.node.spin_once() or params.undo_requests)
        assert "only its gains can change" in params.undo_requests[0].who


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"linear.min_velocity": 0.1, "brake": 1.0}, "linear.min_velocity = 0.1: Expected `float` <= 0.0"),
        ({"linear.max_acceleration": 0.0, "brake": 1.0}, "linear.max_acceleration = 0.0: Expected `float` > 0.0"),
        ({"linear.max_deceleration": 0.0, "brake": 1.0}, "could never change its speed"),
        ({"keep_curvature": True, "linear.max_jerk": 1.0, "brake": 1.0}, "exclude each other"),
        ({"pose_covariance_diagonal": (1.0, 2.0), "brake": 1.0}, "length"),
    ],
)
def test_what_contradicts_itself_changes_nothing_and_is_taken_back(values: dict[str, Any], says: str) -> None:
    with tuned() as (world, params):
        before = world.base.config
        params.publish(SET, values)
        world.run(0.1)
        assert world.base.config is before
        wait_until(lambda: world.node.spin_once() or params.undo_requests)
        assert says in params.undo_requests[0].who
        assert says in world.log
        world.drive(0.2, 0.0, 1.0)
        assert world.base.commanded_velocity[0] == pytest.approx(0.2)


def test_who_sets_the_drive_sets_the_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subscription, "CHANGE_S", 60.0)  # the service's thread may get no processor for half a second
    with tuned(wheel_radius_multiplier=1.2) as (world, params):
        told = world.call(SET_DRIVE, DriveSettings(name=NAME, left_wheel_radius_multiplier=1.1, publish_rate=5))
        assert (told.left_wheel_radius_multiplier, told.right_wheel_radius_multiplier) == (1.1, 1.2)
        assert told.publish_rate == 5
        assert {each.name: each.value for each in params.set_requests[0].values} == {
            "wheel_radius_multiplier": None,
            "left_wheel_radius_multiplier": 1.1,
            "right_wheel_radius_multiplier": 1.2,
            "publish_rate": 5.0,
        }
        tell(world, params, publish_rate=20.0)
        assert world.call(SET_DRIVE, DriveSettings(name=NAME)).publish_rate == 20.0
        assert len(params.set_requests) == 1


def test_a_robot_that_is_gone_follows_nothing_and_one_of_its_name_begins_anew() -> None:
    with tuned() as (world, params):
        world.call(DELETE, Name(name=NAME))
        params.publish(SET, {"brake": 1.0})
        world.simulation.read_inputs(None, 0.0)
        with pytest.raises(CallFailed, match="unknown model"):
            world.call(SET_DRIVE, DriveSettings(name=NAME))
        assert not any(each.name.startswith(SET) for each in world.node.subscribers)
