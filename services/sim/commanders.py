"""Who commands: publisher ids traced to nodes by their liveliness, with a priority by kind of service."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

from messages.names import key as key_of
from services.runtime.graph import Entity, pattern
from services.runtime.network.transport import Transport
from services.runtime.network.wire import MEMBER_BYTES, Origin, publisher_id

PRIORITIES = {"teleop": 10, "panel": 10}
"""By kind of service; everything else commands at 1. A person at the keys, or at a page, wins over a controller."""

FOREIGN = b"foreign"
"""The source of commands without our attachment."""


class Commander(NamedTuple):
    """A node that publishes commands."""

    node: str
    priority: int


UNKNOWN = Commander("", 1)


class Commanders:
    """Follows the publications of the network; ``gone`` gives those whose process left."""

    def __init__(self, transport: Transport) -> None:
        self._kinds: dict[str, str] = {}
        self._known: dict[bytes, Commander] = {}
        self._nodes = transport.watch(pattern("node"))
        self._publications = transport.watch(pattern("pub"))

    def gone(self) -> Iterator[bytes]:
        """The publisher ids that disappeared since the last call."""
        while (event := self._nodes.take()) is not None:
            node = Entity.parse(event.key)
            if node is not None and event.alive:
                self._kinds[node.node] = node.name
        while (event := self._publications.take()) is not None:
            entity = Entity.parse(event.key)
            if entity is None:
                continue
            source = publisher_id(entity.node, entity.session, key_of(entity.name))
            if event.alive:
                priority = PRIORITIES.get(self._kinds.get(entity.node, ""), 1)
                self._known[source] = Commander(entity.node, priority)
            elif self._known.pop(source, None) is not None:
                yield source

    def of(self, members: set[bytes]) -> list[bytes]:
        """The publisher ids of these lives of nodes."""
        return [source for source in self._known if source[:MEMBER_BYTES] in members]

    def find(self, source: bytes) -> Commander:
        """The node behind a publisher id."""
        return self._known.get(source, UNKNOWN)


class Ages:
    """How long a sample was under way, whatever the sender's clock says.

    The least difference between arrival and sending stamp seen from a publisher counts as no delay: a clock that is
    off cancels out, while a burst that waited in a frozen process shows its age.
    """

    def __init__(self) -> None:
        self._least: dict[bytes, int] = {}

    def of(self, origin: Origin) -> float:
        """Age of a sample that arrives now, s of wall time."""
        delay = time.time_ns() - origin.source_ns
        least = self._least.get(origin.publisher)
        if least is None or delay < least:
            self._least[origin.publisher] = least = delay
        return (delay - least) / 1e9
