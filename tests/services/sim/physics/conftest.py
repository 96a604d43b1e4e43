"""An empty world in each installed physics engine, and robots in it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from messages.se3 import Pose3
from models.model import read_model
from models.world import WorldDescription
from services.sim.engines import ENGINES, Engine, has_engine, open_world
from services.sim.physics.world import World
from tests.services.sim.physics.driven_robot import (
    STEP_NS,
    DrivenRobot,
    NewWorld,
    Spawner,
    placement_at,
    ramped_drive,
    robot_body,
    wheels_of,
)


@pytest.fixture(params=[each for each in ENGINES if has_engine(each)])
def engine(request: pytest.FixtureRequest) -> Engine:
    chosen: Engine = request.param
    return chosen


@pytest.fixture
def new_world(engine: Engine) -> NewWorld:
    return lambda description: open_world(engine, description, STEP_NS)


@pytest.fixture
def world(new_world: NewWorld) -> Iterator[World]:
    with new_world(WorldDescription()) as opened:
        yield opened


@pytest.fixture
def spawn(world: World) -> Spawner:
    def spawned(name: str = "robot", model: str = "burger", at: Pose3 | None = None, clamp: bool = True) -> DrivenRobot:
        world.spawn(robot_body(name, model, at or placement_at(0.0, 0.0)))
        return DrivenRobot(world, name, ramped_drive(wheels_of(read_model(model)), clamp=clamp))

    return spawned
