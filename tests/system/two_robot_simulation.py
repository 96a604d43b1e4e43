"""A simulation of two burgers and a reset monitor on a network of their own, shared by the tests of a module."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import psutil

from messages.base import Message
from messages.elea import Health
from messages.requests import Request
from messages.topics import TF_STATIC
from services.runtime.node import Node
from tests.harness.health import ask_health
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder
from tests.harness.processes import Network, Process, parameter_options
from tests.harness.waiting import wait_until

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

RESET_MONITOR = Path(__file__).with_name("reset_monitor.py")
FACTOR = 4
"""Real-time factor, to save wall time."""
STARTS = {"tb3_0": 0.0, "tb3_1": 0.5}
"""y of each robot [m]; x is 0 and both face along x."""


class TwoRobotSimulation:
    """The network, the simulation, its reset monitor, and a node that observes and sends requests."""

    def __init__(self, network: Network, sim: Process, reset_monitor: Process, node: Node) -> None:
        self.network, self.sim, self.reset_monitor, self.node = network, sim, reset_monitor, node
        self.truth = {name: GroundTruthRecorder(node, name) for name in STARTS}
        self.tf_static = MessageRecorder(node.subscribe(TF_STATIC))
        for each in self.truth.values():
            wait_until(lambda e=each: e.received() or sim.status is not None, 30.0, "ground truth")  # type: ignore[misc]
        assert sim.status is None, sim.text

    def call(self, request: Request[Q, R], message: Q) -> R:
        """Call a request, which a busy machine may answer late."""
        return self.node.call(request, message, WITHIN_S)

    def health(self, node: str) -> Health:
        """Return a node's current health."""
        return ask_health(self.node.transport, node)

    @property
    def memory(self) -> float:
        """The simulation's resident memory [MiB]."""
        return psutil.Process(self.sim.pid).memory_info().rss / 2**20


@contextmanager
def two_robot_simulation(logs: Path, mode: str = "real") -> Iterator[TwoRobotSimulation]:
    """Run two burgers at rest with exact odometry, and the reset monitor, a member in lockstep."""
    exact = {"odometry": "world"}
    robots = [{"name": name, "model": "burger", "y": y, "parameters": exact} for name, y in STARTS.items()]
    lockstep = ["--lockstep"] if mode == "lockstep" else []
    settings = {"robots": robots, "mode": mode, "factor": FACTOR, "members": ["/reset_monitor"] if lockstep else []}
    arguments = parameter_options(settings)
    with Network(logs) as network:
        sim = network.start("sim", *arguments, *lockstep)
        reset_monitor = network.run(RESET_MONITOR, *lockstep)
        with network.node() as node:
            yield TwoRobotSimulation(network, sim, reset_monitor, node)
