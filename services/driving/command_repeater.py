"""When a command goes out: at once when it changes, again and again while a key is held, and at last no more."""

from __future__ import annotations

from math import inf
from typing import Generic, Literal, TypeVar

Command = TypeVar("Command")

MAX_SIM_PERIOD_S = 0.1
"""Simulation time after which a command is repeated, however little wall time that is; bases time out after 0.25 s."""


class CommandRepeater(Generic[Command]):
    """Says what to send of what a person wants, where ``still`` is the motion of a robot that stands.

    It holds ``still`` for ``release_after`` [s of simulation time] after a motion, then it is silent.
    Repeats come ``rate`` times a second of wall time, and no more seldom than every KEEP_UP_S of simulation time, so
    that a simulation that is faster than the wall clock does not time out between two. With rate 0 nothing is repeated:
    a command goes out with each key event, one zero at the end.
    """

    def __init__(self, rate: float, release_after: float, still: Command) -> None:
        self.reconfigure(rate, release_after)
        self._zero = still
        self.state: Literal["driving", "stopping", "silent"] = "silent"
        self.sent = still
        self._last_wall = self._last_sim = self._stopping_since = 0.0

    def update(
        self, motion: Command | None, wall: float, sim: float, key_event: bool = False, stop: bool = False
    ) -> Command | None:
        """What to send now, None for nothing.

        ``motion`` is the command that the keys ask for; ``key_event``: a key event came; ``stop``: a key asked
        to stop, which holds the robot even when others drive it. ``wall`` and ``sim`` are the two times, s.
        """
        if motion is not None:
            again = key_event if self._period == inf else self._is_due(wall, sim)
            changed = self.state != "driving" or motion != self.sent
            self.state = "driving"
            return self._send(motion, wall, sim) if changed or again else None
        if self.state == "driving" or stop:
            self.state, self._stopping_since = "stopping", sim
            return self._send(self._zero, wall, sim)
        if self.state == "silent":
            return None
        if self._period == inf or sim - self._stopping_since >= self._release_after:
            self.state = "silent"
            return None
        return self._send(self._zero, wall, sim) if self._is_due(wall, sim) else None

    def reconfigure(self, rate: float, release_after: float) -> None:
        """Repeat at another rate [Hz], and hold zero for another time [s]."""
        self._period = 1 / rate if rate else inf
        self._release_after = release_after

    def reset(self) -> None:
        """Simulation time began anew, and the base has forgotten all commands."""
        self.state = "silent"

    def _is_due(self, wall: float, sim: float) -> bool:
        return wall - self._last_wall >= self._period or sim - self._last_sim >= MAX_SIM_PERIOD_S

    def _send(self, motion: Command, wall: float, sim: float) -> Command:
        self.sent, self._last_wall, self._last_sim = motion, wall, sim
        return motion
