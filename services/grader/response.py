"""The answer of an arm to a step of its set-point: rise, overshoot, settling and what error is left."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from services.grader.records import StepFigures

KEPT_S = 20.0
"""Of a step, so much is measured at most."""
LEAST_S = 1.0
"""A set-point that is left before is no step that could be measured."""
END_S = 0.5
"""The final angle is the mean over so much of the end."""
BAND = 0.02
"""Share of the step that counts as settled."""

Sample = tuple[float, float]


class Step:
    """A set-point that went from ``before`` to ``after`` [deg] at ``begin`` [s] and stays."""

    def __init__(self, begin: float, before: float, after: float) -> None:
        self.begin, self.before, self.after = begin, before, after
        self._samples: list[Sample] = []

    @property
    def size(self) -> float:
        """deg, without sign."""
        return abs(self.after - self.before)

    def add(self, time: float, angle: float) -> None:
        """The arm is truly at ``angle`` [deg] at ``time`` [s]."""
        if time - self.begin <= KEPT_S:
            self._samples.append((time, angle))

    def figures(self) -> StepFigures | None:
        """The figures; None while it is too short, or when the arm stayed where it was."""
        samples = self._samples
        if not samples or samples[-1][0] - self.begin < LEAST_S:
            return None
        end = [angle for time, angle in samples if time > samples[-1][0] - END_S]
        start, final = samples[0][1], sum(end) / len(end)
        way = final - start
        if abs(way) < 0.1 * self.size:
            return None
        shares = [(time, (angle - start) / way) for time, angle in samples]
        return StepFigures(
            at_s=self.begin,
            from_deg=self.before,
            to_deg=self.after,
            final_deg=final,
            rise_s=_crossing(shares, 0.9) - _crossing(shares, 0.1),
            overshoot_percent=100.0 * max(0.0, max(share for _, share in shares) - 1.0),
            settling_s=_settled(shares) - self.begin,
            steady_error_deg=abs(self.after - final),
        )


def _settled(shares: Sequence[Sample]) -> float:
    """When it came into the band for good, on the straight line from its last sample outside to the next one."""
    last = max(number for number, (_, share) in enumerate(shares) if abs(share - 1.0) > BAND)
    (t0, a), (t1, b) = shares[last], shares[min(last + 1, len(shares) - 1)]
    edge = 1.0 + math.copysign(BAND, a - 1.0)
    return t0 if a == b else min(t1, t0 + (t1 - t0) * (edge - a) / (b - a))


def _crossing(shares: Sequence[Sample], level: float) -> float:
    """When the level is first met, on the straight line between two samples."""
    for (t0, a), (t1, b) in pairwise(shares):
        if a < level <= b:
            return t0 + (t1 - t0) * (level - a) / (b - a)
    return shares[-1][0]
