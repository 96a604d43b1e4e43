"""The nodes on the network as a script sees them: who publishes, reads and serves what."""

from __future__ import annotations

import threading
from collections.abc import Mapping

from messages.names import key as key_of
from services.runtime.graph import EVERYTHING, Entity
from services.runtime.transport.api import TokenEvent, TokenWatch, Transport
from services.runtime.transport.wire import publisher_id
from services.script.api import GraphEntry, Origin

_UNKNOWN = Origin("", False)


class Network:
    """Follows the liveliness tokens; its answers come from memory. ``update`` belongs to the node's thread.

    A sample may be taken before the token of its publisher, which came first, was looked at: ``origin`` looks then.
    """

    def __init__(self, transport: Transport) -> None:
        self._watch: TokenWatch = transport.watch(EVERYTHING)
        self._lock = threading.Lock()
        self._following = threading.Lock()
        self._noticed = 0
        self._entities: dict[str, Entity] = {}
        self._origins: dict[bytes, Origin] = {}
        self.version = 0
        """Grows with each change."""

    def update(self) -> bool:
        """Follow what has changed; whether something has since the last call."""
        self._follow()
        before, self._noticed = self._noticed, self.version
        return self.version != before

    def _follow(self) -> None:
        with self._following:
            for event in iter(self._watch.poll, None):
                if (entity := Entity.parse(event.key)) is not None:
                    self._note(entity, event)

    def _note(self, entity: Entity, event: TokenEvent) -> None:
        with self._lock:
            self.version += 1
            if event.alive:
                self._entities[event.key] = entity
            else:
                self._entities.pop(event.key, None)
            if entity.kind == "pub":
                publisher = publisher_id(entity.node, entity.session, key_of(entity.name))
                self._origins[publisher] = Origin(entity.node, entity.detail == "LATCHED")

    def refresh(self) -> None:
        """Ask for the tokens again, for one that was missed while links came up."""
        with self._following:
            self._watch.refresh()

    def origin(self, publisher: bytes) -> Origin:
        """Where the samples of a publisher come from."""
        if (known := self._origins.get(publisher)) is None:
            self._follow()
            known = self._origins.get(publisher, _UNKNOWN)
        return known

    def ends(self, kind: str, name: str) -> list[str]:
        """The nodes that publish (``pub``), read (``sub``) or serve (``srv``) a name, sorted."""
        with self._lock:
            return sorted({each.node for each in self._entities.values() if each.kind == kind and each.name == name})

    def server(self, name: str) -> Entity | None:
        """The server of a name."""
        with self._lock:
            found = [each for each in self._entities.values() if each.kind == "srv" and each.name == name]
        return min(found, key=lambda each: (each.node, each.session), default=None)

    def other_types(self, own: Mapping[str, str]) -> dict[str, tuple[str, str]]:
        """The topics of ``own``, with their types, that another node publishes or reads as another type, and which."""
        with self._lock:
            ends = [each for each in self._entities.values() if each.kind in ("pub", "sub") and each.name in own]
        return {
            each.name: (each.record, each.node)
            for each in sorted(ends, key=lambda each: (each.name, each.node))
            if each.record not in ("-", own[each.name])
        }

    def entries(self) -> list[GraphEntry]:
        """All publications, subscriptions and services."""
        with self._lock:
            ends = [each for each in self._entities.values() if each.kind in ("pub", "sub", "srv")]
        return sorted(
            {GraphEntry(each.kind, each.node, each.name, "*" if each.record == "-" else each.record) for each in ends}
        )

    def nodes(self) -> list[str]:
        """The full names of all nodes, without those of tools, which begin with an underscore."""
        with self._lock:
            names = {each.node for each in self._entities.values() if each.kind == "node"}
        return sorted(each for each in names if not each.rpartition("/")[2].startswith("_"))

    def sessions(self, node: str) -> list[str]:
        """The sessions of the processes that have a node of this name."""
        with self._lock:
            return sorted(
                {each.session for each in self._entities.values() if each.kind == "node" and each.node == node}
            )

    def steppers(self) -> set[str]:
        """The nodes that are ready to step: all that they declared before is known."""
        with self._lock:
            return {each.node for each in self._entities.values() if each.kind in ("step", "ready")}
