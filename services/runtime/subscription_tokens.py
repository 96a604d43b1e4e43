"""Tracks the subscribers of each topic by their liveliness tokens; Zenoh's own matching may be late."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from messages.names import key as key_of
from services.runtime.graph import Entity, token_pattern
from services.runtime.publisher import Publisher
from services.runtime.transport.api import Transport

MAX_TOKENS = 1 << 18
"""Maximum subscriptions counted, so that forged ones cannot exhaust the memory."""

Listener = Callable[[Entity, bool], None]
"""``listener(subscription, alive)``."""


class SubscriptionTokens:
    """Tracks the subscriptions of all nodes of the network.

    A node declares its subscriptions before its readiness, so a node that sees it ready knows all its subscriptions and
    publishes for it from then on, the same in every run. ``listener`` is called for each change, for lockstep.
    """

    def __init__(self, transport: Transport) -> None:
        self.listener: Listener | None = None
        self._watch = transport.watch(token_pattern("sub"))
        self._counts: Counter[str] = Counter()
        self._total = 0
        self.changes = 0
        """Incremented when a topic gets its first declared subscriber, or loses its last."""

    def refresh(self) -> None:
        """Query the network for tokens that were missed."""
        self._watch.refresh()

    def update(self) -> None:
        """Process the changes since the last call."""
        while (event := self._watch.poll()) is not None:
            if (entity := Entity.parse(event.key)) is None:
                continue
            self._count(key_of(entity.name), event.alive)
            if self.listener is not None:
                self.listener(entity, event.alive)

    def mark(self, publishers: Iterable[Publisher[Any]]) -> None:
        """Set ``announced`` of the publishers: whether a node has declared a subscription to their topic."""
        for each in publishers:
            each.announced = each.key in self._counts

    def _count(self, key: str, alive: bool) -> None:
        if alive and self._total < MAX_TOKENS:
            self._total, self.changes = self._total + 1, self.changes + (key not in self._counts)
            self._counts[key] += 1
        elif not alive and key in self._counts:
            self._total -= 1
            self._counts[key] -= 1
            if not self._counts[key]:
                del self._counts[key]
                self.changes += 1
