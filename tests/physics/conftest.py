"""An empty world in real PyBullet, and robots in it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from models.figures import read_model
from models.scene import Scene
from services.sim.diffdrive.driver import Drive
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Placement
from tests.physics.rig import STEP_NS, Driver, Spawner, body, place, wheels_of


@pytest.fixture
def world() -> Iterator[BulletWorld]:
    with BulletWorld(Scene(), STEP_NS) as opened:
        yield opened


@pytest.fixture
def spawn(world: BulletWorld) -> Spawner:
    def spawned(name: str = "robot", model: str = "burger", at: Placement | None = None, clamp: bool = True) -> Driver:
        world.spawn(body(name, model, at or place(0.0, 0.0)))
        return Driver(world, name, Drive.of(wheels_of(read_model(model)), clamp=clamp))

    return spawned
