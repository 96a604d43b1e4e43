"""Nodes on the in-memory transport, their loop in a thread, and a simulation clock set by the test."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from messages.base import encode
from messages.names import Identity
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, Quality
from services.runtime.errors import Stopped
from services.runtime.graph import Kind, token_pattern
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import encoding, pack_attachment


def memory_node(bus: MemoryBus, name: str, namespace: str = "/", transport: Transport | None = None) -> Node:
    """Return a node, not yet entered, whose log is discarded."""
    identity = Identity.of(name, namespace)
    return Node(transport or MemoryTransport(bus), identity, name, Log(identity.node, out=io.StringIO()))


class ManualClock:
    """Publishes ``/clock`` on request."""

    def __init__(self, bus: MemoryBus, publisher: bytes = b"c" * 16) -> None:
        self._publisher = publisher
        transport = MemoryTransport(bus)
        self._outlet = transport.advertise(CLOCK.name[1:], encoding(Clock.ROS_TYPE), Quality.SENSOR)
        self._sent = 0

    def publish(self, ns: int, epoch: int = 0, paused: bool = False) -> None:
        """Publish the simulation time ``ns``."""
        self._sent += 1
        clock = Clock(clock=Time.of(ns), epoch=epoch, paused=paused)
        self._outlet.put(encode(clock), attachment=pack_attachment(self._sent, self._publisher))


def loop_has_begun(made: Node) -> bool:
    """Return whether the node's loop has declared its inputs: from then on it misses no message and no clock."""
    kinds: tuple[Kind, ...] = ("step", "ready")
    return any(made.transport.tokens(token_pattern(kind, made.identity.node)) for kind in kinds)


@contextmanager
def spinning(made: Node) -> Iterator[None]:
    """Run a bare loop of the node in a thread during the block."""
    inlet = made.transport.subscribe("rest", 8)

    def loop() -> None:
        with suppress(Stopped):
            while True:
                made.wait(inlet)
                inlet.recv()

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        yield
    finally:
        made.stopping = True
        made.transport.wake()
        thread.join(60)
        assert not thread.is_alive()
