"""The graph as liveliness tells it: who is there, and what each publishes, reads and serves."""

from __future__ import annotations

from services.runtime.graph import EVERYTHING, Entity
from services.runtime.network.transport import Transport


class Network:
    """Follows the tokens; ``version`` grows with each change. What dies is gone from here as soon as it is noticed."""

    def __init__(self, transport: Transport) -> None:
        self._watch = transport.watch(EVERYTHING)
        self._entities: dict[str, Entity] = {}
        self.version = 0

    def turn(self) -> None:
        """Take what has come and gone."""
        changed = False
        while (event := self._watch.take()) is not None:
            entity = Entity.parse(event.key)
            if entity is None or entity.kind in ("step", "ready"):
                continue
            changed = True
            if event.alive:
                self._entities[event.key] = entity
            else:
                self._entities.pop(event.key, None)
        self.version += changed

    @property
    def entities(self) -> list[Entity]:
        """All there is, in the order of nodes, kinds and names."""
        return sorted(self._entities.values(), key=lambda e: (e.node, e.kind, e.name))

    def published(self, name: str) -> Entity | None:
        """A publication of a topic: it tells type and quality."""
        return next((each for each in self._entities.values() if each.kind == "pub" and each.name == name), None)

    def read(self, name: str) -> Entity | None:
        """A subscription of a topic."""
        return next((each for each in self._entities.values() if each.kind == "sub" and each.name == name), None)

    def ending(self, kind: str, last: str) -> list[Entity]:
        """Publications (``pub``), or subscriptions, of all topics whose last part is ``last``."""
        end = f"/{last}"
        found = [each for each in self._entities.values() if each.kind == kind and each.name.endswith(end)]
        return sorted(found, key=lambda e: e.name)
