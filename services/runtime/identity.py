"""Who a node is, and how the names that it uses resolve to topics and Zenoh keys."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from messages import names


@dataclass(frozen=True)
class Identity:
    """Namespace (``/`` or ``/tb3_0``), absolute name (``/tb3_0/waypoint``) and remapping rules of a node."""

    namespace: str
    node: str
    rules: tuple[names.Remap, ...] = ()

    @classmethod
    def of(cls, name: str, namespace: str = "/", rules: tuple[names.Remap, ...] = ()) -> Self:
        """The identity after the rules that rename the node itself; raises BadName."""
        return cls(*names.identify(name, namespace, rules), rules)

    def resolve(self, name: str) -> str:
        """The absolute name behind ``name`` after remapping; raises BadName."""
        return names.remap(name, self.namespace, self.node, self.rules)

    def key(self, name: str) -> str:
        """The Zenoh key behind ``name``."""
        return names.key(self.resolve(name))
