"""Who else tells of a frame that this service tells of: each frame has one publisher."""

from __future__ import annotations

from collections.abc import Iterable

from messages.tf import TFMessage
from services.runtime.network.wire import Origin

MOST_NEIGHBOURS = 256
"""Publishers that are remembered; beyond that, the first of them is forgotten."""


class Neighbours:
    """The fixed frames of the other publishers.

    Only these are looked at: who subscribes to /tf lets the simulation make it, 25 times a second for all robots.
    """

    def __init__(self, own: bytes) -> None:
        self._own = own
        self._told: dict[bytes, frozenset[str]] = {}
        self._said: set[str] = set()

    def hear(self, batch: Iterable[tuple[TFMessage, Origin | None]]) -> None:
        """Take what came on /tf_static."""
        for message, origin in batch:
            who = origin.publisher if origin is not None else b""
            if who != self._own:
                self._told[who] = frozenset(each.child_frame_id for each in message.transforms)
                if len(self._told) > MOST_NEIGHBOURS:
                    del self._told[next(iter(self._told))]

    def twice(self, frames: frozenset[str]) -> list[str]:
        """Those of our frames that another publisher tells of, each once."""
        found = sorted({name for told in self._told.values() for name in frames & told} - self._said)
        self._said.update(found)
        return found
