"""A commanded motion is the realised motion, in both engines with the settings and models of this project."""

from __future__ import annotations

import math

import pytest

from models import WHEELED
from models.model import read_model
from services.sim.engines import Engine
from services.sim.physics.world import World
from tests.services.sim.physics.driven_robot import DT, Spawner, drive_robots, placement_at, turned, wheels_of, yaw_of


@pytest.mark.slow
@pytest.mark.parametrize("model", WHEELED)
def test_straight_at_full_speed(spawn: Spawner, engine: Engine, model: str) -> None:
    robot = spawn(model=model)
    wheels = wheels_of(read_model(model))
    top = wheels.max_linear
    before = drive_robots([robot], top, 0.0, 1.0 + top / wheels.acceleration)[-1]
    after = drive_robots([robot], top, 0.0, 4.0)[-1]
    way = after.position[0] - before.position[0]
    assert way == pytest.approx(4.0 * top, rel=0.002)
    drift = 0.001 if engine == "pybullet" else 0.0001
    assert abs(after.position[1]) < drift * after.position[0]
    assert abs(after.position[2]) < 2e-4, "it neither sinks nor climbs"


@pytest.mark.slow
@pytest.mark.parametrize("model", WHEELED)
@pytest.mark.parametrize("share", [1.0, 0.2])
def test_spin_on_the_spot(spawn: Spawner, model: str, share: float) -> None:
    robot = spawn(model=model)
    wheels = wheels_of(read_model(model))
    rate = share * wheels.max_angular
    drive_robots([robot], 0.0, rate, 1.0 + rate * wheels.separation / 2 / wheels.acceleration)
    states = drive_robots([robot], 0.0, rate, 4.0)
    assert turned(states) == pytest.approx((len(states) - 1) * DT * rate, rel=0.003)


def test_a_command_beyond_the_hardware_is_clamped(spawn: Spawner) -> None:
    robot = spawn()
    assert drive_robots([robot], 5.0, 0.0, 2.0)[-1].linear[0] == pytest.approx(0.22, rel=0.003)


def test_without_the_clamp_the_tutorial_speed_is_driven(spawn: Spawner) -> None:
    robot = spawn(clamp=False)
    assert drive_robots([robot], 0.707, 0.0, 2.0)[-1].linear[0] == pytest.approx(0.707, rel=0.003)


@pytest.mark.parametrize(("braking", "deceleration"), [(False, 1.0), (True, 2.0)])
def test_the_stop_distance_is_that_of_the_ramp(spawn: Spawner, braking: bool, deceleration: float) -> None:
    """The distance is v^2 / 2a; a ramp in steps of dt ends v dt / 2 earlier or later."""
    robot = spawn()
    start = drive_robots([robot], 0.22, 0.0, 2.0)[-1]
    stop = drive_robots([robot], 0.0, 0.0, 1.0, braking=braking)[-1]
    way = stop.position[0] - start.position[0]
    assert way == pytest.approx(0.22**2 / (2 * deceleration), abs=0.22 * DT)
    assert abs(stop.linear[0]) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("model", WHEELED)
def test_a_resting_robot_does_not_creep(spawn: Spawner, world: World, model: str) -> None:
    robot = spawn(model=model, at=placement_at(1.0, 2.0, 0.3))
    settled = drive_robots([robot], 0.0, 0.0, 0.5)[-1]
    later = drive_robots([robot], 0.0, 0.0, 5.0)[-1]
    assert math.dist(settled.position, later.position) < 5e-7
    assert abs(yaw_of(later) - yaw_of(settled)) < 5e-7
