"""The same calls give the same numbers, bit for bit: in a fresh world, after a reset, after deletions."""

from __future__ import annotations

import pytest

from models import urdf_path
from models.world import WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics.world import Body, BodyState, World
from tests.services.sim.physics.driven_robot import NewWorld, placement_at, robot_body

pytestmark = pytest.mark.slow

Trajectory = list[tuple[BodyState, ...]]


def _crowd() -> list[Body]:
    burgers = [robot_body(f"tb3_{i}", "burger", placement_at(0.0, 0.5 * i, 1.57)) for i in range(3)]
    return [*burgers, robot_body("p3dx", "p3dx", placement_at(0.0, 1.9, -1.57))]


def _run(world: World, steps: int = 500) -> Trajectory:
    """Drive robots into each other, so that contacts matter."""
    states = []
    for step in range(steps):
        if step == 20:
            for i, name in enumerate(world.names):
                world.body(name).set_speeds((6.0 - 3.0 * i, 6.5 - 2.0 * i))
        world.step()
        states.append(tuple(world.body(name).state() for name in world.names))
    return states


def test_fresh_equals_fresh_equals_reset(new_world: NewWorld) -> None:
    runs = []
    for _ in range(2):
        with new_world(WorldDescription()) as world:
            for each in _crowd():
                world.spawn(each)
            runs.append(_run(world))
            world.reset()
            runs.append(_run(world))
    assert len({tuple(run) for run in runs}) == 1
    assert runs[0][0] != runs[0][-1], "they moved"


def test_a_reset_forgets_the_motors(new_world: NewWorld) -> None:
    with new_world(WorldDescription()) as world:
        world.spawn(robot_body("a", "burger", placement_at(0.0, 0.0)))
        world.body("a").set_speeds((5.0, 5.0))
        for _ in range(100):
            world.step()
        world.reset()
        for _ in range(100):
            world.step()
        assert abs(world.body("a").state().position[0]) < 1e-6
        assert max(abs(angle) for angle in world.body("a").joint_readings().position) < 1e-6


def test_a_refused_spawn_leaves_no_trace(new_world: NewWorld) -> None:
    runs = []
    for intrude in (False, True):
        with new_world(WorldDescription()) as world:
            for each in _crowd():
                world.spawn(each)
                if intrude:
                    with pytest.raises(BadInput):
                        world.spawn(robot_body("intruder", "waffle", each.pose))
            runs.append(_run(world))
    assert runs[0] == runs[1]


def test_delete_and_spawn_is_repeatable_and_a_reset_starts_with_those_that_stay(new_world: NewWorld) -> None:
    after_reset, after_exchange = [], []
    for _ in range(2):
        with new_world(WorldDescription()) as world:
            for each in _crowd():
                world.spawn(each)
            _run(world, 100)
            world.delete("tb3_0")
            world.spawn(Body("newcomer", urdf_path("waffle"), placement_at(3.0, 0.0)))
            assert world.names == ("tb3_1", "tb3_2", "p3dx", "newcomer")
            after_exchange.append([_step_states(world) for _ in range(100)])
            world.reset()
            after_reset.append([_step_states(world) for _ in range(100)])
    with new_world(WorldDescription()) as world:
        for each in (*_crowd()[1:], Body("newcomer", urdf_path("waffle"), placement_at(3.0, 0.0))):
            world.spawn(each)
        fresh = [_step_states(world) for _ in range(100)]
    assert after_exchange[0] == after_exchange[1]
    assert after_reset[0] == after_reset[1] == fresh


def _step_states(world: World) -> tuple[BodyState, ...]:
    world.step()
    return tuple(world.body(name).state() for name in world.names)
