"""Where a node's samples leave: each at once, or those of a burst in one go."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Put = Callable[..., Any]
"""``put(payload, attachment=…)`` of an outlet."""


class Outbox:
    """Passes samples on, in order. Between ``hold`` and ``release`` it keeps them.

    ``held`` is what it keeps, None when it keeps nothing: an output looks for itself, as it is asked for every message.
    What is put in one go travels in few packets and wakes each reader once or twice, not once for each sample.
    """

    def __init__(self) -> None:
        self.held: list[tuple[Put, bytes, bytes]] | None = None

    def put(self, put: Put, payload: bytes, attachment: bytes) -> None:
        """Send a sample by the ``put`` of its outlet, or keep it for the burst."""
        if self.held is None:
            put(payload, attachment=attachment)
        else:
            self.held.append((put, payload, attachment))

    def hold(self) -> None:
        """Begin a burst; it ends by itself when the node's loop waits."""
        if self.held is None:
            self.held = []

    def release(self) -> None:
        """Send what was kept, and from now on everything at once."""
        held, self.held = self.held, None
        for put, payload, attachment in held or ():
            put(payload, attachment=attachment)
