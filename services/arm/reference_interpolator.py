"""Interpolates the arm's set-point between reference samples, which arrive less often than the controller runs."""

from __future__ import annotations

import math
from collections import deque
from itertools import islice
from typing import NamedTuple

WINDOW = 16
"""Intervals over which the period is averaged: a jitter of one tick changes it by a sixteenth of a tick."""
MIN_SAMPLES = 8
"""Samples after which missing ones are detected; until then, each counts as the next."""
NEXT_SAMPLE_PERIODS = 0.2, 1.8
"""Range of periods since the last sample in which a sample counts as the next, early or late."""
DELAY_GAIN = 0.25
"""Share of a sample's delay that is attributed to the publisher's clock."""
MAX_GAP_PERIODS = 5
"""Periods without a sample beyond which there is a gap and a new series starts."""


class PeriodEstimator:
    """Estimates the publisher's period and phase from jittered arrivals.

    In lockstep, samples arrive on time. In real time, one may arrive a tick or two late, which would look as if the
    reference stood still and then jumped.

    Attributes:
        period: Period of the samples [ns]; 0 while unknown.
        nominal_time: Time at which the last sample was due [ns].
    """

    def __init__(self) -> None:
        self.period = self.nominal_time = 0.0
        self._arrivals: deque[tuple[int, int]] = deque(maxlen=WINDOW + 1)

    def add_sample(self, now: int) -> int | None:
        """Add a sample that arrived at ``now`` [ns]; return the number of periods between it and the one before.

        None for the first of a series; 0 for one that replaces the one before, which was late.
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
        due = self.nominal_time + count * self.period
        self.nominal_time = due + DELAY_GAIN * (now - due)
        return count

    def _periods_since_last(self, now: int) -> int:
        if len(self._arrivals) < MIN_SAMPLES or not self.period:
            return 1
        passed = (now - self.nominal_time) / self.period
        return 1 if NEXT_SAMPLE_PERIODS[0] < passed < NEXT_SAMPLE_PERIODS[1] else max(0, round(passed))


NS = 1e-9
SAME_MOTION_SHARE, SAME_MOTION_RATE = 0.2, 2.0
"""Relative and absolute [deg/s] difference of two rates of one motion: a sine of 30 deg, 0.2 Hz has up to 1 deg/s."""
MAX_MOTION_PERIOD_S = 0.1
"""Longest period [s] of references that form a motion; less frequent ones are steps."""
MAX_EXTRAPOLATION_PERIODS, STANDSTILL_PERIODS = 1.5, 2.0
"""Periods since the last sample up to which a motion is extrapolated, and beyond which it counts as stopped."""


class SetPoint(NamedTuple):
    """Set-point at one instant: angle [deg], rate [deg/s], acceleration [deg/s2]."""

    angle: float
    rate: float = 0.0
    acceleration: float = 0.0


class Slope(NamedTuple):
    """Mean rate [deg/s] between two samples, and the time between them [s]."""

    rate: float = 0.0
    span: float = 0.0


class ReferenceInterpolator:
    """Extrapolates the reference between its samples. All times are simulation time [ns].

    If the last two rates are similar, the reference continues as a parabola: a sine sampled at 50 Hz becomes smooth.
    Otherwise it stays until the next sample: a step remains a step, and so do infrequent references. Without
    ``smooth``, it always stays, as in the tutorial.
    """

    def __init__(self) -> None:
        self.sample: float | None = None
        self._arrival = 0
        self._period_estimator = PeriodEstimator()
        self._previous_sample: float | None = None
        self._span = self._rate = self._acceleration = 0.0
        self._slope = self._previous_slope = Slope()

    def add_sample(self, sample: float, now: int) -> None:
        """Add a reference [deg] that arrived at ``now``."""
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
        """Return the time since the last sample [s]; inf before the first."""
        return math.inf if self.sample is None else (now - self._arrival) * NS

    def at(self, now: int, smooth: bool, span: int = 0) -> SetPoint:
        """Return the set-point at ``now``, extrapolated for at most MAX_EXTRAPOLATION_PERIODS; needs a sample.

        Args:
            now: Simulation time [ns].
            smooth: Extrapolate; otherwise, return the last sample.
            span: Time span before ``now`` over which the rate is averaged [ns], as for the measured rate.
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
        """Stay at the last sample, as no more are expected."""
        self._previous_sample = None
        self._rate = self._acceleration = 0.0
        self._slope = self._previous_slope = Slope()

    def _extrapolate(self, now: Slope, before: Slope) -> None:
        if abs(now.rate - before.rate) < max(SAME_MOTION_SHARE * abs(now.rate), SAME_MOTION_RATE):
            self._acceleration = 2 * (now.rate - before.rate) / (now.span + before.span)
            self._rate = now.rate + self._acceleration * now.span / 2
