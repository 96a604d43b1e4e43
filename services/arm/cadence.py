"""When samples were meant that come at the ticks of a loop: what their sender's clock does, out of late arrivals."""

from __future__ import annotations

from collections import deque
from itertools import islice

WINDOW = 16
"""Intervals over whose mean the period is known: one tick more or less is a sixteenth of one."""
SURE = 8
"""Samples of a series after which one may be found missing; until then each is the next."""
NEXT = 0.2, 1.8
"""Periods after the one before between which a sample is the next one, if early or late."""
FOLLOW = 0.25
"""Share of a sample's lateness that counts as the sender's."""
GAP = 5
"""More than so many periods without a sample are a gap: what comes then is another series."""


class Cadence:
    """The ``period`` [ns] of samples, 0 while it is not known, and ``at`` [ns], when the last of them was meant.

    In lockstep each comes when it is meant. In real time one may come a tick or two late, and would look as if the
    reference stood still and then leapt.
    """

    def __init__(self) -> None:
        self.period = self.at = 0.0
        self._arrivals: deque[tuple[int, int]] = deque(maxlen=WINDOW + 1)

    def take(self, now: int) -> int | None:
        """A sample came at ``now`` [ns]; returns how many periods after the one before it was meant.

        None for the first of a series; 0 for one that takes the place of the one before, which was late.
        """
        arrivals = self._arrivals
        if arrivals and self.period and now - arrivals[-1][0] > GAP * self.period:
            arrivals.clear()
        if not arrivals:
            arrivals.append((now, 0))
            self.period, self.at = 0.0, float(now)
            return None
        count = self._count(now)
        arrivals.append((now, count))
        if total := sum(each for _, each in islice(arrivals, 1, None)):
            self.period = (now - arrivals[0][0]) / total
        meant = self.at + count * self.period
        self.at = meant + FOLLOW * (now - meant)
        return count

    def _count(self, now: int) -> int:
        if len(self._arrivals) < SURE or not self.period:
            return 1
        passed = (now - self.at) / self.period
        return 1 if NEXT[0] < passed < NEXT[1] else max(0, round(passed))
