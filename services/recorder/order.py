"""The order in which messages were sent, out of the one in which they come: a command overtakes the clock."""

from __future__ import annotations

import time
from bisect import bisect_right
from typing import Any

from services.recorder.times import arrival
from services.runtime.inputs import Input
from services.runtime.network.wire import Origin

SETTLE_S = 0.1
"""Wall time for which a message waits for those that were sent before it."""

Heard = tuple[Input[Any], Any, Origin | None]
"""An input, a message of it, and where that came from."""


class Order:
    """Keeps messages until none that was sent earlier is to be expected."""

    def __init__(self) -> None:
        self._since = time.time_ns()
        self._waiting: list[tuple[int, Heard]] = []

    def put(self, heard: Heard, wall: int) -> None:
        """A message was there at ``wall`` [ns]."""
        origin = heard[2]
        self._waiting.append((arrival(origin.source_ns if origin is not None else None, self._since, wall), heard))

    def take(self, wall: int, end: bool) -> list[tuple[int, Heard]]:
        """What was sent SETTLE_S before ``wall`` [ns] or earlier, by its time of arrival; at the ``end`` everything."""
        self._since = wall if end else max(self._since, wall - round(SETTLE_S * 1e9))
        self._waiting.sort(key=_arrived)
        ripe = bisect_right(self._waiting, self._since, key=_arrived)
        taken, self._waiting = self._waiting[:ripe], self._waiting[ripe:]
        return taken


def _arrived(entry: tuple[int, Heard]) -> int:
    return entry[0]
