"""Simulation time in the panel: the time of a message, and the clock channel of the page.

Each sample carries its sender's system time, and each ``/clock`` also the simulation time. On one machine, or several
with synchronized clocks, the simulation time of a sample is interpolated between the system times of the clocks.
"""

from __future__ import annotations

from collections import deque

from messages.rosgraph import Clock
from messages.topics import CLOCK
from services.panel.protocol import as_json
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.clock_map import ClockMap
from services.runtime.transport.wire import SampleInfo

FACTOR_WINDOW_S = 2.0
"""Wall time [s] over which the real-time factor is measured."""
CLOCK_TIMEOUT_S = 1.0
"""Wall time [s] without a clock after which it counts as missing."""


class ClockChannel:
    """Sends time, epoch, pause and real-time factor ten times a second."""

    period, streams = 0.1, False

    def __init__(self, subscriptions: SharedSubscriptions, time: SimTimeMap) -> None:
        self.version = 0
        self._subscriptions, self._time = SubscriptionGroup(subscriptions), time
        self._topic = (CLOCK.name, Clock.ROS_TYPE)
        self._seen: deque[tuple[float, int]] = deque()
        self._last_received = 0.0
        self._silent = False

    def set_enabled(self, enabled: bool) -> None:
        self._subscriptions.set_topics({self._topic: CLOCK.quality.name} if enabled else {})
        if not enabled:
            self._seen.clear()

    def update(self, now: float) -> None:
        batch = self._subscriptions.messages(*self._topic)
        epoch = self._time.epoch
        for clock, origin in batch:
            self._time.add(clock, origin)
        if batch:
            if epoch != self._time.epoch:
                self._seen.clear()
            self._last_received = now
            self._seen.append((now, self._time.now))
            while self._seen[0][0] < now - FACTOR_WINDOW_S and len(self._seen) > 2:
                self._seen.popleft()
        silent = now - self._last_received > CLOCK_TIMEOUT_S
        if batch or silent != self._silent:
            self.version += 1
            self._silent = silent

    def delta(self, since: int) -> str | None:
        return as_json(
            "clock",
            t=self._time.now / 1e9,
            epoch=self._time.epoch,
            paused=self._time.paused,
            alive=self._time.known and not self._silent,
            factor=self._factor(),
        )

    def _factor(self) -> float | None:
        """Return the real-time factor over the last FACTOR_WINDOW_S; None while paused or without a clock."""
        if len(self._seen) < 2 or self._time.paused or self._silent:
            return None
        (wall, sim), (wall_now, sim_now) = self._seen[0], self._seen[-1]
        return round((sim_now - sim) / 1e9 / (wall_now - wall), 2) if wall_now - wall > 0.2 else None


MAX_CLOCKS = 512
"""Minimum clock samples kept: 10 s at 50 Hz."""


class SimTimeMap:
    """Maps samples to simulation time. ``epoch`` is incremented at each reset and by another simulation."""

    def __init__(self) -> None:
        self.now = 0
        self.epoch = 0
        self.paused = False
        self.known = False
        self._clock_epoch = -1
        self._map = ClockMap(MAX_CLOCKS)

    def add(self, clock: Clock, origin: SampleInfo | None) -> None:
        """Add a clock sample."""
        now = clock.clock.ns
        if self.known and (clock.epoch != self._clock_epoch or now < self.now):
            self.epoch += 1
            self._map.clear()
        self.now, self.paused, self.known, self._clock_epoch = now, clock.paused, True, clock.epoch
        if origin is not None:
            self._map.add(origin.source_ns, now)

    def at(self, origin: SampleInfo | None) -> int:
        """Return the simulation time [ns] at which a sample was sent: interpolated, or that of the last clock.

        A sample without origin counts as sent now.
        """
        time = None if origin is None else self._map.between(origin.source_ns)
        return self.now if time is None else time
