"""What the arm is to do, out of references that come less often than it acts: the angle, and how fast it changes."""

from __future__ import annotations

import math
from typing import NamedTuple

NS = 1e-9
ALIKE, ALIKE_DEG = 0.2, 2.0
"""Share, or deg/s, by which two rates may differ that belong to one motion: a sine of 30 deg and 0.2 Hz has up to 1."""
OVERDUE = 2
"""Intervals after the last sample at which it is taken to stand still."""


class Motion(NamedTuple):
    """What is wanted at an instant: deg, deg/s, deg/s2."""

    angle: float
    rate: float = 0.0
    acceleration: float = 0.0


class Target:
    """The reference between its samples. All times are simulation time, ns.

    Where its last two rates are alike it goes on as they tell, as a parabola: a sine of 50 Hz becomes smooth. Where
    they are not it waits for the next sample: a step stays a step. With ``smooth`` off it always waits, as in the
    tutorial.
    """

    def __init__(self) -> None:
        self.sample: float | None = None
        self._at = self._interval = 0
        self._rate = self._acceleration = self._mean = 0.0

    def take(self, sample: float, now: int) -> None:
        """A new reference [deg] that came at ``now``."""
        if self.sample is not None and now > self._at:
            self._interval = now - self._at
            before, self._mean = self._mean, (sample - self.sample) / (self._interval * NS)
            self._rate = self._acceleration = 0.0
            if abs(self._mean - before) < max(ALIKE * abs(self._mean), ALIKE_DEG):
                self._acceleration = (self._mean - before) / (self._interval * NS)
                self._rate = self._mean + self._acceleration * self._interval * NS / 2
        self.sample, self._at = sample, now

    def age(self, now: int) -> float:
        """Seconds since the last sample; inf before the first."""
        return math.inf if self.sample is None else (now - self._at) * NS

    def at(self, now: int, smooth: bool, span: int = 0) -> Motion:
        """What is wanted at ``now``; there must be a sample. It goes on for one interval at most.

        The rate is the mean over ``span`` until now, as the measured one is that it is compared with.
        """
        assert self.sample is not None
        if not smooth:
            return Motion(self.sample)
        since = min(now - self._at, self._interval) * NS
        angle = self.sample + (self._rate + self._acceleration * since / 2) * since
        if now - self._at > OVERDUE * self._interval:
            return Motion(angle)
        return Motion(angle, self._rate + self._acceleration * (since - span * NS / 2), self._acceleration)

    def rest(self) -> None:
        """No more samples are expected: stay at the last."""
        self._rate = self._acceleration = self._mean = 0.0
