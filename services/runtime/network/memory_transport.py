"""The transport in memory: for tests of loops without processes, under the same conformance suite as Zenoh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from messages.requests import LARGEST_REQUEST
from messages.topics import Quality
from services.runtime.errors import BadInput
from services.runtime.network.backlog import Backlog, Refusals
from services.runtime.network.memory_ends import (
    MemoryBus,
    MemoryInlet,
    MemoryOutlet,
    MemoryPending,
    MemoryQuery,
    MemoryServer,
    MemoryToken,
    MemoryWatch,
    matches,
)
from services.runtime.network.transport import BEAT_S, TIMEOUT, Inlet, Reply

__all__ = ["MemoryBus", "MemoryTransport"]


class MemoryTransport:
    """One connection to a MemoryBus."""

    settle_s = 0.0

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus
        self.session = f"{next(bus.numbers):032x}"
        self.open = True
        self._nudged = False
        self._owned: list[MemoryInlet | MemoryOutlet | MemoryToken] = []
        self._servers: list[MemoryServer] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def subscribe(self, key: str, capacity: int, latched: bool = False) -> MemoryInlet:
        inlet = MemoryInlet(self._bus, key, capacity)
        with self._bus.changed:
            if latched:
                inlet.samples.extend(each for each in self._bus.latched.values() if matches(key, each[2][1]))
            self._bus.inlets.append(inlet)
        self._owned.append(inlet)
        return inlet

    def publish(self, key: str, encoding: str, quality: Quality) -> MemoryOutlet:
        if "*" in key:
            raise BadInput(f"cannot publish on {key!r}: a publication has no wildcards")
        outlet = MemoryOutlet(self._bus, key, encoding, quality is Quality.LATCHED)
        self._owned.append(outlet)
        return outlet

    def serve(self, key: str, largest: int = LARGEST_REQUEST, refusals: Refusals | None = None) -> MemoryServer:
        server = MemoryServer(key, self, Backlog(largest, refusals))
        with self._bus.changed:
            self._bus.servers.append(server)
        self._servers.append(server)
        return server

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        with self._bus.changed:
            asked = self._ask(key, payload)
            self._bus.changed.wait_for(lambda: all(each.answer for each in asked), timeout)
        return [each.answer or Reply(False, TIMEOUT) for each in asked]

    def ask(self, key: str, payload: bytes, timeout: float) -> MemoryPending:
        with self._bus.changed:
            return MemoryPending(self._ask(key, payload), timeout)

    def token(self, key: str) -> MemoryToken:
        token = MemoryToken(self._bus, key)
        with self._bus.changed:
            self._bus.tokens[key] = 1
            self._bus.show(key, True)
        self._owned.append(token)
        return token

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        with self._bus.changed:
            return sorted(key for key in self._bus.tokens if matches(pattern, key))

    def watch(self, pattern: str) -> MemoryWatch:
        with self._bus.changed:
            watch = MemoryWatch(pattern, self.tokens(pattern), self)
            self._bus.watches.append(watch)
        return watch

    def wait(self, inlet: Inlet) -> None:
        assert isinstance(inlet, MemoryInlet)
        with self._bus.changed:
            self._bus.changed.wait_for(lambda: bool(inlet.samples) or self._nudged, BEAT_S)
            self._nudged = False

    def nudge(self) -> None:
        with self._bus.changed:
            self._nudged = True
            self._bus.changed.notify_all()

    def close(self) -> None:
        self.open = False
        for each in self._owned:
            each.close()
        with self._bus.changed:
            self._bus.servers = [each for each in self._bus.servers if each not in self._servers]

    def _ask(self, key: str, payload: bytes) -> list[MemoryQuery]:
        asked = []
        for server in self._bus.servers:
            if matches(server.key, key):
                query = MemoryQuery(self._bus, key, payload, server.owner.session)
                asked.append(query)
                server.hear(query)
        return asked
