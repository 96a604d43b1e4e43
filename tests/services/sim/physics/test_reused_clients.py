"""A PyBullet client that another world had before gives the same as a new one, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from messages.se3 import Pose3
from models.bodies import Light
from models.world import Box, WorldDescription
from services.sim.physics import engine
from services.sim.physics._pybullet import pybullet
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import BodyState, CameraModel
from tests.services.sim.physics.driven_robot import STEP_NS, placement_at, robot_body

WALL = Box(name="wall", size=(0.2, 8.0, 0.1), position=(0.6, 0.0, 0.05))
PLAIN = WorldDescription(boxes=(WALL,))
DUSK = replace(PLAIN, lights=(Light("sun", direction=(1.0, 0.0, -0.2), colour=(1.0, 0.3, 0.1)),))
EYE, LENS = Pose3((0.4, 0.0, 3.0), (1.0, 0.0, 0.0, 0.0)), CameraModel(32, 24, 0.6, 0.05, 20.0)

Outcome = tuple[list[BodyState], bytes]
"""The trajectory of a robot, and an image."""


@pytest.fixture(autouse=True)
def idle(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The closed clients of this test alone."""
    clients: list[int] = []
    monkeypatch.setattr(engine, "_idle", clients)
    yield clients
    for client in clients:
        pybullet.disconnect(physicsClientId=client)


def along_the_wall(description: WorldDescription, cone_friction: int = 1) -> Outcome:
    """Drive a Pioneer slantwise into the wall, which depends on all settings of its contacts."""
    with BulletWorld(description, STEP_NS) as world:
        pybullet.setPhysicsEngineParameter(enableConeFriction=cone_friction, physicsClientId=world._client)
        body = world.spawn(robot_body("robot", "p3dx", placement_at(0.0, 0.0, math.pi / 4)))
        body.set_speeds((5.0, 5.0))
        states = []
        for _ in range(500):
            world.step()
            states.append(body.state())
        return states, world.render(EYE, LENS)


def test_a_world_is_the_same_after_one_with_a_light_or_other_friction(idle: list[int]) -> None:
    states, image = along_the_wall(PLAIN)
    assert len(idle) == engine.MAX_IDLE_CLIENTS == 2
    lit = along_the_wall(DUSK)
    assert len(idle) == 1, "the client that keeps the light is not used again"
    assert lit[0] == states
    assert lit[1] != image
    assert along_the_wall(PLAIN, cone_friction=0)[0] != states
    assert along_the_wall(PLAIN) == (states, image)
    assert len(idle) == 2
