"""The nodes that publish commands, with their priorities; publisher ids are resolved by liveliness tokens."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from messages.names import key as key_of
from services.runtime.graph import Entity, token_pattern
from services.runtime.transport.api import Transport
from services.runtime.transport.wire import MEMBER_BYTES, NODE_BYTES, publisher_id

PRIORITIES = {"teleop": 10, "panel": 10}
"""By kind of service; all others have priority 1. A person at the keyboard or the panel wins over a controller."""

MAX_NAMES = 1024
"""Maximum number of node names remembered."""

FOREIGN_SOURCE = b"foreign"
"""The source of all commands without our attachment."""


class CommandSource(NamedTuple):
    """A node that publishes commands."""

    node: str
    priority: int


UNKNOWN_SOURCE = CommandSource("", 1)


class CommandSources:
    """Tracks the publishers on the network; ``lost_publishers`` yields those that are gone.

    The kind of service of a node comes from the node token of its current instance, as long as that exists; tokens may
    arrive in any order.
    """

    def __init__(self, transport: Transport) -> None:
        self._kinds: dict[tuple[str, str], str] = {}
        self._publishers: dict[bytes, tuple[str, str]] = {}
        self._names: dict[bytes, str] = {}
        self._node_tokens = transport.watch(token_pattern("node"))
        self._publisher_tokens = transport.watch(token_pattern("pub"))

    def lost_publishers(self) -> Iterator[bytes]:
        """Process the token events, and yield the ids of publishers lost since the last call."""
        while (event := self._node_tokens.poll()) is not None:
            node = Entity.parse(event.key)
            if node is None:
                continue
            instance = node.node, node.session
            if event.alive:
                self._kinds[instance] = node.name
            else:
                self._kinds.pop(instance, None)
        while (event := self._publisher_tokens.poll()) is not None:
            entity = Entity.parse(event.key)
            if entity is None:
                continue
            source = publisher_id(entity.node, entity.session, key_of(entity.name))
            if event.alive:
                self._publishers[source] = entity.node, entity.session
                self._remember(source[:NODE_BYTES], entity.node)
            elif self._publishers.pop(source, None) is not None:
                yield source

    def publishers_of(self, members: set[bytes]) -> list[bytes]:
        """Return the publisher ids of these node instances."""
        return [source for source in self._publishers if source[:MEMBER_BYTES] in members]

    def find(self, source: bytes) -> CommandSource:
        """Return the node behind a publisher id."""
        if (instance := self._publishers.get(source)) is None:
            return UNKNOWN_SOURCE
        return CommandSource(instance[0], PRIORITIES.get(self._kinds.get(instance, ""), 1))

    def node_name(self, node: bytes) -> str:
        """Return the name of the node whose publisher ids begin with these NODE_BYTES; empty if none was seen.

        Names are kept after a node has left: a message from a short-lived tool may arrive after its token is gone.
        """
        return self._names.get(node, "")

    def _remember(self, node: bytes, name: str) -> None:
        self._names.pop(node, None)
        self._names[node] = name
        if len(self._names) > MAX_NAMES:
            del self._names[next(iter(self._names))]
