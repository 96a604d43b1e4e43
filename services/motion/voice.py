"""When a command goes out: at once when it changes, again and again while a key is held, and at last no more."""

from __future__ import annotations

from math import inf
from typing import Generic, Literal, TypeVar

Motion = TypeVar("Motion")

KEEP_UP_S = 0.1
"""Simulation time after which a command is repeated, however little wall time that is; bases time out after 0.25 s."""


class Voice(Generic[Motion]):
    """Says what to send of what a person wants, where ``still`` is the motion of a robot that stands.

    It holds ``still`` for ``give_way`` [s of simulation time] after a motion, then it is silent.
    Repeats come ``rate`` times a second of wall time, and no more seldom than every KEEP_UP_S of simulation time, so
    that a simulation that is faster than the wall clock does not time out between two. With rate 0 nothing is repeated:
    a command goes out with each key event, one zero at the end.
    """

    def __init__(self, rate: float, give_way: float, still: Motion) -> None:
        self.retune(rate, give_way)
        self._still = still
        self.state: Literal["driving", "stopping", "silent"] = "silent"
        self.sent = still
        self._wall = self._sim = self._since = 0.0

    def say(
        self, motion: Motion | None, wall: float, sim: float, struck: bool = False, stop: bool = False
    ) -> Motion | None:
        """What to send now, None for nothing.

        ``motion`` is what the hand wants; ``struck`` tells that a key came, ``stop`` that one asked to stop: that holds
        the robot even when others drive it. ``wall`` and ``sim`` are the two times, s.
        """
        if motion is not None:
            again = struck if self._period == inf else self._due(wall, sim)
            changed = self.state != "driving" or motion != self.sent
            self.state = "driving"
            return self._send(motion, wall, sim) if changed or again else None
        if self.state == "driving" or stop:
            self.state, self._since = "stopping", sim
            return self._send(self._still, wall, sim)
        if self.state == "silent":
            return None
        if self._period == inf or sim - self._since >= self._give_way:
            self.state = "silent"
            return None
        return self._send(self._still, wall, sim) if self._due(wall, sim) else None

    def retune(self, rate: float, give_way: float) -> None:
        """Repeat at another rate [Hz], and hold zero for another time [s]."""
        self._period = 1 / rate if rate else inf
        self._give_way = give_way

    def restart(self) -> None:
        """Simulation time began anew, and the base has forgotten all commands."""
        self.state = "silent"

    def _due(self, wall: float, sim: float) -> bool:
        return wall - self._wall >= self._period or sim - self._sim >= KEEP_UP_S

    def _send(self, motion: Motion, wall: float, sim: float) -> Motion:
        self.sent, self._wall, self._sim = motion, wall, sim
        return motion
