"""A simulation of two burgers and a witness on a network of their own, shared by the tests of a module."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from messages.elea import Health
from messages.topics import HEALTH, TF_STATIC
from services.runtime.node import Node
from tests.processes import Network, Process
from tests.system.watched import WITHIN_S, Truth, Watched
from tests.waiting import until

WITNESS = Path(__file__).with_name("witness.py")
FACTOR = 4
"""Simulated per wall-clock second, to be quick."""
STARTS = {"tb3_0": 0.0, "tb3_1": 0.5}
"""y of each robot, m; x is 0, both look along x."""


class World:
    """The network, the simulation, its witness, and a node beside them that looks on and asks."""

    def __init__(self, network: Network, sim: Process, witness: Process, node: Node) -> None:
        self.network, self.sim, self.witness, self.node = network, sim, witness, node
        self.truth = {name: Truth(node, name) for name in STARTS}
        self.health = Watched(node.read(HEALTH))
        self.fixed = Watched(node.read(TF_STATIC))
        for each in self.truth.values():
            until(lambda e=each: e.all() or sim.status is not None, 30.0, "ground truth")  # type: ignore[misc]
        assert sim.status is None, sim.text

    def beat(self, node: str) -> Health:
        """The next heartbeat of a node."""
        count = len(self.health.all())

        def heard() -> list[Health]:
            return [each for each in self.health.all()[count:] if each.node == node]

        return until(heard, WITHIN_S, f"a heartbeat of {node}")[0]

    def sent(self, topic: str) -> int:
        """How many messages the simulation has sent on a topic."""
        return next(each.sent for each in self.beat("/sim").outputs if each.topic == topic)

    @property
    def memory(self) -> float:
        """Resident memory of the simulation, MiB."""
        return psutil.Process(self.sim.pid).memory_info().rss / 2**20


@contextmanager
def world(logs: Path, mode: str = "real") -> Iterator[World]:
    """Two burgers at rest, and the witness; in lockstep the simulation waits for it."""
    robots = [{"name": name, "model": "burger", "y": y} for name, y in STARTS.items()]
    lockstep = ["--lockstep"] if mode == "lockstep" else []
    settings = {"robots": robots, "mode": mode, "factor": FACTOR, "members": ["/witness"] if lockstep else []}
    arguments = [word for key, value in settings.items() for word in ("--param", f"{key}={json.dumps(value)}")]
    with Network(logs) as network:
        sim = network.start("sim", *arguments, *lockstep)
        witness = network.run(WITNESS, *lockstep)
        with network.node() as node:
            yield World(network, sim, witness, node)
