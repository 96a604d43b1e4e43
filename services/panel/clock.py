"""The channel of time: where the simulation stands, and how fast it runs."""

from __future__ import annotations

from collections import deque

from messages.rosgraph import Clock
from messages.topics import CLOCK
from services.panel.channel import as_json
from services.panel.feeds import Feeds, Hold
from services.panel.sim_time import SimTime

WINDOW_S = 2.0
"""Wall time over which the speed is taken."""
SILENCE_S = 1.0
"""Wall time without a clock after which there is none."""


class ClockChannel:
    """Tells time, era, pause and speed ten times a second."""

    period, streams = 0.1, False

    def __init__(self, feeds: Feeds, time: SimTime) -> None:
        self.version = 0
        self._hold, self._time = Hold(feeds), time
        self._place = (CLOCK.name, Clock.ROS_TYPE)
        self._seen: deque[tuple[float, int]] = deque()
        self._heard = 0.0
        self._told = False

    def follow(self, wanted: bool) -> None:
        self._hold.want({self._place: CLOCK.quality.name} if wanted else {})
        if not wanted:
            self._seen.clear()

    def turn(self, now: float) -> None:
        batch = self._hold.batch(*self._place)
        era = self._time.era
        for clock, origin in batch:
            self._time.add(clock, origin)
        if batch:
            if era != self._time.era:
                self._seen.clear()
            self._heard = now
            self._seen.append((now, self._time.now))
            while self._seen[0][0] < now - WINDOW_S and len(self._seen) > 2:
                self._seen.popleft()
        silent = now - self._heard > SILENCE_S
        if batch or silent != self._told:
            self.version += 1
            self._told = silent

    def news(self, since: int) -> str | None:
        return as_json(
            "clock",
            t=self._time.now / 1e9,
            era=self._time.era,
            paused=self._time.paused,
            alive=self._time.known and not self._told,
            factor=self._factor(),
        )

    def _factor(self) -> float | None:
        """Simulated per wall-clock second, lately."""
        if len(self._seen) < 2 or self._time.paused or self._told:
            return None
        (wall, sim), (wall_now, sim_now) = self._seen[0], self._seen[-1]
        return round((sim_now - sim) / 1e9 / (wall_now - wall), 2) if wall_now - wall > 0.2 else None
