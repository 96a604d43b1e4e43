"""The network's nodes as a script sees them: who publishes, subscribes to and serves what."""

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
    """Follows the liveliness tokens; ``update`` belongs to the node's thread.

    A query first processes the tokens that have arrived, so that what the script has just declared is known at once,
    as with a ROS master.
    """

    def __init__(self, transport: Transport) -> None:
        self._watch: TokenWatch = transport.watch(EVERYTHING)
        # Reentrant, for a signal may run a shutdown hook while the main thread holds one.
        self._lock, self._following = threading.RLock(), threading.RLock()
        self._noticed = 0
        self._entities: dict[str, Entity] = {}
        self._endpoints: dict[str, dict[str, Entity]] = {}
        """The publications and subscriptions of each topic."""
        self._origins: dict[bytes, Origin] = {}
        self.version = 0
        """Incremented at each change."""

    def update(self) -> bool:
        """Process changes; return whether there were any since the last call."""
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
            if entity.kind in ("pub", "sub"):
                ends = self._endpoints.setdefault(entity.name, {})
                if event.alive:
                    ends[event.key] = entity
                else:
                    ends.pop(event.key, None)
                if not ends:
                    del self._endpoints[entity.name]
            if entity.kind == "pub":
                publisher = publisher_id(entity.node, entity.session, key_of(entity.name))
                self._origins[publisher] = Origin(entity.node, entity.detail == "LATCHED")

    def refresh(self) -> None:
        """Query the tokens again, for one that was missed while links came up."""
        with self._following:
            self._watch.refresh()

    def origin(self, publisher: bytes) -> Origin:
        """Return the source of a publisher's samples."""
        if (known := self._origins.get(publisher)) is None:
            self._follow()
            known = self._origins.get(publisher, _UNKNOWN)
        return known

    def publishers(self, name: str) -> set[bytes]:
        """Return the ids of a topic's publications."""
        self._follow()
        with self._lock:
            ends = [each for each in self._endpoints.get(name, {}).values() if each.kind == "pub"]
        return {publisher_id(each.node, each.session, key_of(name)) for each in ends}

    def endpoint_nodes(self, kind: str, name: str) -> list[str]:
        """Return the nodes that publish (``pub``), subscribe to (``sub``) or serve (``srv``) a name, sorted."""
        self._follow()
        with self._lock:
            return sorted({each.node for each in self._entities.values() if each.kind == kind and each.name == name})

    def server(self, name: str) -> Entity | None:
        """Return the server of a name; None without one."""
        self._follow()
        with self._lock:
            found = [each for each in self._entities.values() if each.kind == "srv" and each.name == name]
        return min(found, key=lambda each: (each.node, each.session), default=None)

    def other_types(self, own: Mapping[str, str]) -> dict[str, tuple[str, str]]:
        """Return the topics of ``own``, given with their types, that another node uses with another type, and that
        type.
        """
        with self._lock:
            ends = [each for name in own for each in self._endpoints.get(name, {}).values()]
        return {
            each.name: (each.record, each.node)
            for each in sorted(ends, key=lambda each: (each.name, each.node))
            if each.record not in ("-", own[each.name])
        }

    def entries(self) -> list[GraphEntry]:
        """Return all publications, subscriptions and services."""
        self._follow()
        with self._lock:
            ends = [each for each in self._entities.values() if each.kind in ("pub", "sub", "srv")]
        return sorted(
            {GraphEntry(each.kind, each.node, each.name, "*" if each.record == "-" else each.record) for each in ends}
        )

    def nodes(self) -> list[str]:
        """Return the full names of all nodes, without those of tools, which begin with an underscore."""
        self._follow()
        with self._lock:
            names = {each.node for each in self._entities.values() if each.kind == "node"}
        return sorted(each for each in names if not each.rpartition("/")[2].startswith("_"))

    def sessions(self, node: str) -> list[str]:
        """Return the sessions of the processes that have a node of this name."""
        self._follow()
        with self._lock:
            return sorted(
                {each.session for each in self._entities.values() if each.kind == "node" and each.node == node}
            )

    def steppers(self) -> set[str]:
        """Return the nodes that are ready to step: everything that they declared before is known."""
        with self._lock:
            return {each.node for each in self._entities.values() if each.kind in ("step", "ready")}
