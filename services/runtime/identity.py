"""Who a node is, and how the names that it uses resolve to topics and Zenoh keys."""

from __future__ import annotations

from dataclasses import dataclass

from messages import names


@dataclass(frozen=True)
class Identity:
    """Namespace (``/`` or ``/tb3_0``), name, and the remappings of a node."""

    namespace: str
    name: str
    remaps: tuple[tuple[str, str], ...] = ()

    @property
    def node(self) -> str:
        """The full name, ``/tb3_0/waypoint``."""
        return names.resolve(self.name, self.namespace, self.name)

    def resolve(self, name: str) -> str:
        """The absolute name behind ``name`` after remapping; raises BadName."""
        absolute = names.resolve(name, self.namespace, self.name)
        for source, target in self.remaps:
            if names.resolve(source, self.namespace, self.name) == absolute:
                return names.resolve(target, self.namespace, self.name)
        return absolute

    def key(self, name: str) -> str:
        """The Zenoh key behind ``name``."""
        return names.key(self.resolve(name))
