"""Simulation time of messages that carry none: what the clock showed when they were sent.

The sender's system clock stands beside every sample, the simulation's beside every ``/clock``. On one machine, and on
several with clocks kept together, the first is looked up among the second.
"""

from __future__ import annotations

from messages.rosgraph import Clock
from services.runtime.clock_map import ClockMap
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
        self._map = ClockMap(KEPT)

    def add(self, clock: Clock, origin: Origin | None) -> None:
        """Take a clock."""
        now = clock.clock.ns
        if self.known and (clock.epoch != self._epoch or now < self.now):
            self.era += 1
            self._map.clear()
        self.now, self.paused, self.known, self._epoch = now, clock.paused, True, clock.epoch
        if origin is not None:
            self._map.add(origin.source_ns, now)

    def at(self, origin: Origin | None) -> int:
        """Simulation time [ns] when a sample was sent; between two clocks by proportion, after the last one the last.

        A sample without origin was sent just now.
        """
        time = None if origin is None else self._map.between(origin.source_ns)
        return self.now if time is None else time
