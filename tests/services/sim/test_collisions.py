"""A base reports its contacts, and counts each collision once."""

from __future__ import annotations

import pytest

from messages.topics import BASE_STATUS, CMD_VEL
from services.sim.physics.world import Contact
from tests.services.sim.drive.simulation_harness import NAME, run_simulation


def test_a_collision_counts_once_when_it_begins_also_after_a_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    with run_simulation() as world:
        touching: list[Contact] = []
        monkeypatch.setattr(world.simulation.world, "contacts", lambda: tuple(touching))

        def told() -> tuple[bool, int]:
            world.run(0.4)
            status = world.received(BASE_STATUS)[-1]
            return status.colliding, status.collisions

        assert told() == (False, 0)
        touching.append(Contact(NAME, "wall"))
        assert told() == (True, 1)
        assert told() == (True, 1), "it goes on"
        touching.append(Contact(NAME, "door"))
        assert told() == (True, 2)
        world.simulation.reset(False)
        assert told() == (True, 4), "a new start in the same place"
        touching.clear()
        assert told() == (False, 4)


def test_a_reset_of_time_restarts_the_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    with run_simulation() as world:
        touching: tuple[Contact, ...] = (Contact(NAME, "wall"),)
        monkeypatch.setattr(world.simulation.world, "contacts", lambda: touching)
        world.drive(0.3, 0.0, 0.4)
        world.publish_raw(CMD_VEL, b"nonsense")
        world.run(0.6)
        world.simulation.reset(False)
        touching = ()
        before = world.status()
        assert (before.collisions, before.commands, before.commands_timed_out, before.refused) == (1, 10, 1, 1)
        assert before.last_command.ns > 0
        world.simulation.reset(True)
        again = world.status()
        assert (again.collisions, again.commands, again.commands_timed_out, again.refused) == (0, 0, 0, 0)
        assert again.last_command.ns == 0
        world.publish_raw(CMD_VEL, b"nonsense")
        world.drive(0.3, 0.0, 0.4)
        assert (world.status().commands, world.status().refused) == (10, 1)
