"""What the arm is to do, out of references that come less often than it acts: the angle, and how fast it changes."""

from __future__ import annotations

import math
from typing import NamedTuple

from services.arm.cadence import Cadence

NS = 1e-9
ALIKE, ALIKE_DEG = 0.2, 2.0
"""Share, or deg/s, by which two rates may differ that belong to one motion: a sine of 30 deg and 0.2 Hz has up to 1."""
SLOW_S = 0.1
"""References that come more seldom than this are no motion: each is a step, and nothing goes on between them."""
LATE, OVERDUE = 1.5, 2.0
"""Periods after the last sample up to which a motion goes on, and from which on it is taken to stand still."""


class Motion(NamedTuple):
    """What is wanted at an instant: deg, deg/s, deg/s2."""

    angle: float
    rate: float = 0.0
    acceleration: float = 0.0


class Slope(NamedTuple):
    """The mean rate [deg/s] between two samples, and the time between them [s]."""

    rate: float = 0.0
    span: float = 0.0


class Target:
    """The reference between its samples. All times are simulation time, ns.

    Where its last two rates are alike it goes on as they tell, as a parabola: a sine of 50 Hz becomes smooth. Where
    they are not it waits for the next sample: a step stays a step, and so do references that come seldom. With
    ``smooth`` off it always waits, as in the tutorial.
    """

    def __init__(self) -> None:
        self.sample: float | None = None
        self._came = 0
        self._cadence = Cadence()
        self._before: float | None = None
        self._span = self._rate = self._acceleration = 0.0
        self._slope = self._slope_before = Slope()

    def take(self, sample: float, now: int) -> None:
        """A new reference [deg] that came at ``now``."""
        count = self._cadence.take(now)
        if count is None:
            self.rest()
        elif count:
            self._before, self._slope_before = self.sample, self._slope
            self._span = count * self._cadence.period * NS
        self.sample, self._came = sample, now
        self._slope, self._rate, self._acceleration = Slope(), 0.0, 0.0
        if self._before is not None and 0 < self._span <= SLOW_S:
            self._slope = Slope((sample - self._before) / self._span, self._span)
            self._go_on(self._slope, self._slope_before)

    def age(self, now: int) -> float:
        """Seconds since the last sample; inf before the first."""
        return math.inf if self.sample is None else (now - self._came) * NS

    def at(self, now: int, smooth: bool, span: int = 0) -> Motion:
        """What is wanted at ``now``; there must be a sample. It goes on for LATE periods at most.

        The rate is the mean over ``span`` until now, as the measured one is that it is compared with.
        """
        assert self.sample is not None
        if not smooth:
            return Motion(self.sample)
        passed, period = (now - self._cadence.at) * NS, self._cadence.period * NS
        since = max(-period, min(passed, LATE * period))
        angle = self.sample + (self._rate + self._acceleration * since / 2) * since
        if passed > OVERDUE * period:
            return Motion(angle)
        return Motion(angle, self._rate + self._acceleration * (since - span * NS / 2), self._acceleration)

    def rest(self) -> None:
        """No more samples are expected: stay at the last."""
        self._before = None
        self._rate = self._acceleration = 0.0
        self._slope = self._slope_before = Slope()

    def _go_on(self, now: Slope, before: Slope) -> None:
        if abs(now.rate - before.rate) < max(ALIKE * abs(now.rate), ALIKE_DEG):
            self._acceleration = 2 * (now.rate - before.rate) / (now.span + before.span)
            self._rate = now.rate + self._acceleration * now.span / 2
