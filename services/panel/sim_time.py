"""Simulation time of messages that carry none: what the clock showed when they were sent.

The sender's system clock stands beside every sample, the simulation's beside every ``/clock``. On one machine, and on
several with clocks kept together, the first is looked up among the second.
"""

from __future__ import annotations

from bisect import bisect_right

from messages.rosgraph import Clock
from services.runtime.network.wire import Origin

KEPT = 512
"""Clocks remembered: 10 s at 50 Hz."""


class SimTime:
    """``era`` grows whenever time begins anew: a reset, or another simulation."""

    def __init__(self) -> None:
        self.now = 0
        self.era = 0
        self.paused = False
        self.known = False
        self._epoch = -1
        self._sent: list[int] = []
        self._times: list[int] = []

    def add(self, clock: Clock, origin: Origin | None) -> None:
        """Take a clock."""
        now = clock.clock.ns
        if self.known and (clock.epoch != self._epoch or now < self.now):
            self.era += 1
            self._sent, self._times = [], []
        self.now, self.paused, self.known, self._epoch = now, clock.paused, True, clock.epoch
        if origin is None or (self._sent and origin.source_ns <= self._sent[-1]):
            return
        self._sent.append(origin.source_ns)
        self._times.append(now)
        if len(self._sent) > 2 * KEPT:
            del self._sent[:KEPT], self._times[:KEPT]

    def at(self, origin: Origin | None) -> int:
        """Simulation time [ns] when a sample was sent; between two clocks by proportion, after the last one the last.

        A sample without origin was sent just now.
        """
        if origin is None or not self._sent or origin.source_ns >= self._sent[-1]:
            return self.now
        index = bisect_right(self._sent, origin.source_ns)
        if index == 0:
            return self._times[0]
        before, after = self._sent[index - 1], self._sent[index]
        share = (origin.source_ns - before) / (after - before)
        return self._times[index - 1] + round(share * (self._times[index] - self._times[index - 1]))
