"""What the arm is to do, out of references that come less often than it acts: the angle, and how fast it changes."""

from __future__ import annotations

import math

NS = 1e-9


class Target:
    """The reference between its samples. All times are simulation time, ns.

    It goes on at the slower of its last two rates, and not at all when they differ in sign: a sine of 50 Hz becomes
    smooth, a step stays a step. With ``smooth`` off it stays where its last sample is, as in the tutorial.
    """

    def __init__(self) -> None:
        self.sample: float | None = None
        self._at = self._interval = 0
        self._rate = self._last = 0.0

    def take(self, sample: float, now: int) -> None:
        """A new reference [deg] that came at ``now``."""
        if self.sample is not None and now > self._at:
            self._interval = now - self._at
            rate = (sample - self.sample) / (self._interval * NS)
            self._rate, self._last = _slower(rate, self._last), rate
        self.sample, self._at = sample, now

    def age(self, now: int) -> float:
        """Seconds since the last sample; inf before the first."""
        return math.inf if self.sample is None else (now - self._at) * NS

    def at(self, now: int, smooth: bool) -> tuple[float, float]:
        """Angle [deg] and its rate [deg/s] at ``now``; there must be a sample. It goes on for one interval at most."""
        assert self.sample is not None
        if not smooth:
            return self.sample, 0.0
        return self.sample + self._rate * min(now - self._at, self._interval) * NS, self._rate

    def rest(self) -> None:
        """No more samples are expected: stay at the last."""
        self._rate = self._last = 0.0


def _slower(a: float, b: float) -> float:
    return 0.0 if a * b <= 0 else math.copysign(min(abs(a), abs(b)), a)
