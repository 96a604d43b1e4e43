"""A node in a running fleet that sets and gets its parameters and receives their changes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from messages.elea import Health
from messages.names import Identity
from messages.parameters import Assignment, ParameterSet, ParameterValues, SetParameters
from messages.requests import PARAMS_GET, PARAMS_SET
from messages.topics import CLOCK, CMD_VEL, HEALTH
from services.runtime.errors import CallFailed
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.waiting import wait_until

WITHIN_S = 60.0
"""Wall time limit of a request, on a busy machine."""


class ParameterClient:
    """Sets and gets parameters and receives their updates."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._commands = {robot: node.subscribe(CMD_VEL, f"/{robot}/cmd_vel") for robot in ("r", "s")}
        self._health, self._clock = node.subscribe(HEALTH), node.subscribe(CLOCK)
        self._speed = {"r": 0.0, "s": 0.0}
        self._beats: dict[str, Health] = {}

    def set(self, name: str, run: bool = False, **values: Any) -> ParameterValues:
        stated = tuple(Assignment(name=each.replace("__", "."), value=value) for each, value in values.items())
        return self.node.call(PARAMS_SET, SetParameters(set=name, values=stated, run=run, who="test"), WITHIN_S)

    def get(self, name: str) -> dict[str, tuple[Any, str]]:
        told = self.node.call(PARAMS_GET, ParameterSet(set=name), WITHIN_S)
        return {each.name: (each.value, each.origin) for each in told.values}

    def wait_for(self, name: str, **expected: tuple[Any, str]) -> None:
        def there() -> bool:
            try:
                return expected.items() <= self.get(name).items()
            except CallFailed:
                return False

        wait_until(there, 30, f"{name} {expected}")

    def wait_for_speed(self, wanted: float, robot: str = "r", within: float = 1e-6) -> None:
        """Wait until the robot's controller commands this speed [m/s]."""

        def there() -> bool:
            self.node.update_subscribers()
            for each, commands in self._commands.items():
                for command, _ in commands.messages:
                    self._speed[each] = command.linear.x
            return abs(self._speed[robot] - wanted) <= within

        wait_until(there, 20, f"{wanted} m/s commanded to {robot}")

    def wall_time_of(self, seconds: float) -> float:
        """Return the wall time [s] that ``seconds`` of simulation time take, by the sending times of the clock."""
        self.node.update_subscribers()
        sent: list[tuple[int, int]] = []

        def there() -> bool:
            self.node.update_subscribers()
            sent.extend((clock.clock.ns, origin.source_ns) for clock, origin in self._clock.messages if origin)
            return bool(sent) and sent[-1][0] - sent[0][0] >= seconds * 1e9

        wait_until(there, 30, f"{seconds} s of simulation time")
        return (sent[-1][1] - sent[0][1]) / 1e9

    def rejected_samples(self, node: str, topic: str) -> int:
        """Return how many samples of a topic a node has rejected, from its heartbeat."""
        self.node.update_subscribers()
        for beat, _ in self._health.messages:
            self._beats[beat.node] = beat
        known = self._beats.get(node, Health())
        return sum(each.refused for each in known.inputs if each.topic == topic)


@contextmanager
def parameter_client(port: int) -> Iterator[ParameterClient]:
    identity = Identity.of("tuner")
    with (
        ZenohTransport(configuration("direct", (router_endpoint(port),))) as transport,
        Node(transport, identity, "tester", Log(identity.node)) as node,
    ):
        yield ParameterClient(node)
