"""The subscribers of each topic by their liveliness tokens: reliable where the network's own matching may come late."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from messages.names import key as key_of
from services.runtime.graph import Entity, token_pattern
from services.runtime.publisher import Publisher
from services.runtime.transport.api import Transport

MAX_TOKENS = 1 << 18
"""Maximum number of subscriptions that are counted, so that forged ones cannot fill the memory."""

Listener = Callable[[Entity, bool], None]
"""``listener(subscription, alive)``."""


class SubscriptionTokens:
    """Follows the subscriptions of all nodes of the network.

    A node declares its subscriptions and then its readiness, so a node that has seen it ready knows all its
    subscriptions and publishes for it from then on, the same in every run. ``listener`` hears of each change, for
    lockstep.
    """

    def __init__(self, transport: Transport) -> None:
        self.listener: Listener | None = None
        self._watch = transport.watch(token_pattern("sub"))
        self._counts: Counter[str] = Counter()
        self._total = 0
        self.changes = 0
        """Grows with each topic that gets its first announced reader, or loses its last."""

    def refresh(self) -> None:
        """Ask the network for tokens that were missed."""
        self._watch.refresh()

    def update(self) -> None:
        """Take what has changed."""
        while (event := self._watch.poll()) is not None:
            if (entity := Entity.parse(event.key)) is None:
                continue
            self._count(key_of(entity.name), event.alive)
            if self.listener is not None:
                self.listener(entity, event.alive)

    def mark(self, publishers: Iterable[Publisher[Any]]) -> None:
        """Tell publishers whether a node has announced that it reads them."""
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
