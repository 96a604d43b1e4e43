"""An empty world in real PyBullet, and robots in it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from messages.se3 import Pose3
from models.model import read_model
from models.world import WorldDescription
from services.sim.drive.driver import Drive
from services.sim.physics.bullet import BulletWorld
from tests.services.sim.physics.driven_robot import STEP_NS, DrivenRobot, Spawner, placement_at, robot_body, wheels_of


@pytest.fixture
def world() -> Iterator[BulletWorld]:
    with BulletWorld(WorldDescription(), STEP_NS) as opened:
        yield opened


@pytest.fixture
def spawn(world: BulletWorld) -> Spawner:
    def spawned(name: str = "robot", model: str = "burger", at: Pose3 | None = None, clamp: bool = True) -> DrivenRobot:
        world.spawn(robot_body(name, model, at or placement_at(0.0, 0.0)))
        return DrivenRobot(world, name, Drive.of(wheels_of(read_model(model)), clamp=clamp))

    return spawned
