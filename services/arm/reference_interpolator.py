"""The set-point of the arm between reference samples that arrive less often than the controller runs."""

from __future__ import annotations

import math
from collections import deque
from itertools import islice
from typing import NamedTuple

WINDOW = 16
"""Intervals over whose mean the period is known: one tick more or less is a sixteenth of one."""
MIN_SAMPLES = 8
"""Samples of a series after which one may be found missing; until then each is the next."""
NEXT_SAMPLE_PERIODS = 0.2, 1.8
"""Periods after the one before between which a sample is the next one, if early or late."""
DELAY_GAIN = 0.25
"""Share of a sample's lateness that counts as the sender's."""
MAX_GAP_PERIODS = 5
"""More than so many periods without a sample are a gap: what comes then is another series."""


class PeriodEstimator:
    """The ``period`` [ns] of samples, 0 while it is not known, and ``at`` [ns], when the last of them was meant.

    In lockstep each comes when it is meant. In real time one may come a tick or two late, and would look as if the
    reference stood still and then leapt.
    """

    def __init__(self) -> None:
        self.period = self.nominal_time = 0.0
        self._arrivals: deque[tuple[int, int]] = deque(maxlen=WINDOW + 1)

    def add_sample(self, now: int) -> int | None:
        """A sample came at ``now`` [ns]; returns how many periods after the one before it was meant.

        None for the first of a series; 0 for one that takes the place of the one before, which was late.
        """
        arrivals = self._arrivals
        if arrivals and self.period and now - arrivals[-1][0] > MAX_GAP_PERIODS * self.period:
            arrivals.clear()
        if not arrivals:
            arrivals.append((now, 0))
            self.period, self.nominal_time = 0.0, float(now)
            return None
        count = self._periods_since_last(now)
        arrivals.append((now, count))
        if total := sum(each for _, each in islice(arrivals, 1, None)):
            self.period = (now - arrivals[0][0]) / total
        meant = self.nominal_time + count * self.period
        self.nominal_time = meant + DELAY_GAIN * (now - meant)
        return count

    def _periods_since_last(self, now: int) -> int:
        if len(self._arrivals) < MIN_SAMPLES or not self.period:
            return 1
        passed = (now - self.nominal_time) / self.period
        return 1 if NEXT_SAMPLE_PERIODS[0] < passed < NEXT_SAMPLE_PERIODS[1] else max(0, round(passed))


NS = 1e-9
SAME_MOTION_SHARE, SAME_MOTION_RATE = 0.2, 2.0
"""Share, or deg/s, by which two rates may differ that belong to one motion: a sine of 30 deg and 0.2 Hz has up to 1."""
MAX_MOTION_PERIOD_S = 0.1
"""References that come more seldom than this are no motion: each is a step, and nothing goes on between them."""
MAX_EXTRAPOLATION_PERIODS, STANDSTILL_PERIODS = 1.5, 2.0
"""Periods after the last sample up to which a motion goes on, and from which on it is taken to stand still."""


class SetPoint(NamedTuple):
    """What is wanted at an instant: deg, deg/s, deg/s2."""

    angle: float
    rate: float = 0.0
    acceleration: float = 0.0


class Slope(NamedTuple):
    """The mean rate [deg/s] between two samples, and the time between them [s]."""

    rate: float = 0.0
    span: float = 0.0


class ReferenceInterpolator:
    """The reference between its samples. All times are simulation time, ns.

    Where its last two rates are alike it goes on as they tell, as a parabola: a sine of 50 Hz becomes smooth. Where
    they are not it waits for the next sample: a step stays a step, and so do references that come seldom. With
    ``smooth`` off it always waits, as in the tutorial.
    """

    def __init__(self) -> None:
        self.sample: float | None = None
        self._arrival = 0
        self._period_estimator = PeriodEstimator()
        self._previous_sample: float | None = None
        self._span = self._rate = self._acceleration = 0.0
        self._slope = self._previous_slope = Slope()

    def add_sample(self, sample: float, now: int) -> None:
        """A new reference [deg] that came at ``now``."""
        count = self._period_estimator.add_sample(now)
        if count is None:
            self.hold()
        elif count:
            self._previous_sample, self._previous_slope = self.sample, self._slope
            self._span = count * self._period_estimator.period * NS
        self.sample, self._arrival = sample, now
        self._slope, self._rate, self._acceleration = Slope(), 0.0, 0.0
        if self._previous_sample is not None and 0 < self._span <= MAX_MOTION_PERIOD_S:
            self._slope = Slope((sample - self._previous_sample) / self._span, self._span)
            self._extrapolate(self._slope, self._previous_slope)

    def age(self, now: int) -> float:
        """Seconds since the last sample; inf before the first."""
        return math.inf if self.sample is None else (now - self._arrival) * NS

    def at(self, now: int, smooth: bool, span: int = 0) -> SetPoint:
        """What is wanted at ``now``; there must be a sample. It goes on for LATE periods at most.

        The rate is the mean over ``span`` until now, as the measured one is that it is compared with.
        """
        assert self.sample is not None
        if not smooth:
            return SetPoint(self.sample)
        passed, period = (now - self._period_estimator.nominal_time) * NS, self._period_estimator.period * NS
        since = max(-period, min(passed, MAX_EXTRAPOLATION_PERIODS * period))
        angle = self.sample + (self._rate + self._acceleration * since / 2) * since
        if passed > STANDSTILL_PERIODS * period:
            return SetPoint(angle)
        return SetPoint(angle, self._rate + self._acceleration * (since - span * NS / 2), self._acceleration)

    def hold(self) -> None:
        """No more samples are expected: stay at the last."""
        self._previous_sample = None
        self._rate = self._acceleration = 0.0
        self._slope = self._previous_slope = Slope()

    def _extrapolate(self, now: Slope, before: Slope) -> None:
        if abs(now.rate - before.rate) < max(SAME_MOTION_SHARE * abs(now.rate), SAME_MOTION_RATE):
            self._acceleration = 2 * (now.rate - before.rate) / (now.span + before.span)
            self._rate = now.rate + self._acceleration * now.span / 2
