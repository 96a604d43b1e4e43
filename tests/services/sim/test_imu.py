"""IMUs read together give the same as each alone, whichever others are spawned, deleted or read in between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

from messages.se3 import Pose3
from messages.sensor import Imu
from messages.topics import IMU
from models.world import WorldDescription
from services.runtime.node import Node
from services.runtime.step import STEP_NS
from services.runtime.subscriber import Subscriber
from services.runtime.transport.memory import MemoryBus
from services.sim.engines import ENGINES, Engine, open_world
from services.sim.parameters import BaseParameters, RobotEntry
from services.sim.simulation import Simulation
from tests.harness.memory_node import memory_node


class Stand:
    """A simulation and subscribers to its IMUs."""

    def __init__(self, simulation: Simulation, reader: Node) -> None:
        self.simulation, self._reader = simulation, reader
        self._subscribers: dict[str, Subscriber[Imu]] = {}

    def spawn(self, name: str, x: float, noise: bool = True) -> None:
        entry = RobotEntry(name=name, model="burger", parameters=BaseParameters(noise=noise))
        self.simulation.spawn(entry, Pose3((x, 0.0, 0.0)))

    def read(self, name: str) -> None:
        self._subscribers[name] = self._reader.subscribe(IMU, f"/{name}/imu")

    def leave(self, name: str) -> None:
        self._reader.unregister(self._subscribers.pop(name))

    def run(self, steps: int) -> dict[str, list[Imu]]:
        """Run ``steps`` steps; return the IMU messages by robot."""
        for _ in range(steps):
            self.simulation.publish()
            self.simulation.step()
        self._reader.update_subscribers()
        return {name: [message for message, _ in each.messages] for name, each in self._subscribers.items()}


@contextmanager
def stand(engine: Engine) -> Iterator[Stand]:
    bus = MemoryBus()
    with (
        memory_node(bus, "sim") as node,
        memory_node(bus, "reader") as reader,
        open_world(engine, WorldDescription(), STEP_NS) as world,
    ):
        yield Stand(Simulation(node, world, 7), reader)


def stamps(messages: Sequence[Imu]) -> list[int]:
    return [each.header.stamp.ns // STEP_NS for each in messages]


@pytest.mark.parametrize("engine", ENGINES)
def test_units_together_and_alone(engine: Engine) -> None:
    with stand(engine) as both, stand(engine) as one:
        for each in (both, one):
            each.spawn("a", 0.0)
            each.spawn("b", 1.0, noise=False)
        both.read("a")
        both.read("b")
        one.read("b")
        together, alone = both.run(9), one.run(9)
        assert stamps(together["a"]) == [2, 4, 6, 8], "the first look gives nothing"
        assert alone["b"] == together["b"]
        assert len({each.angular_velocity.x for each in together["a"]}) == 4
        assert together["a"] != together["b"]

        both.spawn("c", 2.0)
        one.spawn("c", 2.0)
        both.read("c")
        one.read("a")
        after, alone = both.run(6), one.run(6)
        assert stamps(after["a"]) == stamps(after["b"]) == [10, 12, 14], "who comes does not interrupt the others"
        assert stamps(after["c"]) == stamps(alone["a"]) == [12, 14]
        assert alone["a"] == after["a"][1:]

        both.leave("a")
        both.simulation.delete("c")
        assert stamps(both.run(4)["b"]) == [16, 18]
        both.read("a")
        assert stamps(both.run(4)["a"]) == [22]

        both.simulation.reset(time_too=True)
        again = both.run(5)
        assert stamps(again["a"]) == stamps(again["b"]) == [2, 4]
        assert again["a"] == together["a"][:2]
