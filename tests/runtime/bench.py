"""A node on an in-memory network, and a sim clock under the test's control."""

from __future__ import annotations

import io

from messages.base import encode
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, Quality
from services.runtime.identity import Identity
from services.runtime.log import Log
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.transport import Transport
from services.runtime.network.wire import attach, encoding
from services.runtime.node import Node


def node(bus: MemoryBus, name: str, namespace: str = "/", transport: Transport | None = None) -> Node:
    """A node, not yet entered; its log goes nowhere."""
    identity = Identity.of(name, namespace)
    return Node(transport or MemoryTransport(bus), identity, name, Log(identity.node, out=io.StringIO()))


class HandClock:
    """Publishes ``/clock`` when told."""

    def __init__(self, bus: MemoryBus, publisher: bytes = b"c" * 16) -> None:
        self._publisher = publisher
        transport = MemoryTransport(bus)
        self._outlet = transport.publish(CLOCK.name[1:], encoding(Clock.ROS_TYPE), Quality.SENSOR)
        self._sent = 0

    def tell(self, ns: int, epoch: int = 0, paused: bool = False) -> None:
        """Simulation time is ``ns``."""
        self._sent += 1
        clock = Clock(clock=Time.of(ns), epoch=epoch, paused=paused)
        self._outlet.put(encode(clock), attachment=attach(self._sent, self._publisher))
