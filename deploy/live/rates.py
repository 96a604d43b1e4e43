"""How often something happens: figures over the newest samples, exact in the presence of losses and of bursts."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

SECOND = 1e9


class Sample(NamedTuple):
    """One message: its simulation time (None when no clock tells it) and wall time [ns], the number lost before it,
    and its size [bytes].
    """

    time: int | None
    sent: int
    lost: int = 0
    size: int = 0


@dataclass(frozen=True)
class Rate:
    """Messages per second over ``span`` [s], those that were lost among them; ``count`` of them in it.

    Intervals between two messages with nothing lost between them: least, most and standard deviation [s].
    """

    hz: float
    span: float
    count: int
    least: float
    most: float
    deviation: float


class Window:
    """The newest samples of one topic, ``length`` of them at most; ``received`` and ``lost`` count from the start."""

    def __init__(self, length: int) -> None:
        self.samples: deque[Sample] = deque(maxlen=length)
        self.received = self.lost = 0

    def add(self, sample: Sample) -> None:
        """Take a sample; one whose simulation time lies before the last one's begins a new window."""
        self.received += 1
        self.lost += sample.lost
        before = self.samples[-1].time if self.samples else None
        if before is not None and sample.time is not None and sample.time < before - SECOND:
            self.samples.clear()
        self.samples.append(sample)

    def simulated(self) -> Rate | None:
        """The rate by simulation time. What has none counts between its neighbours, as what was lost does."""
        moments: list[tuple[int, int]] = []
        between = 0
        for each in self.samples:
            between += each.lost
            if each.time is None:
                between += 1
            else:
                moments.append((each.time, between))
                between = 0
        return rate(moments)

    @property
    def untimed(self) -> int:
        """Samples whose simulation time is not known."""
        return sum(each.time is None for each in self.samples)

    def wall(self) -> Rate | None:
        """The rate by the clocks of the senders."""
        return rate([(each.sent, each.lost) for each in self.samples])

    def sizes(self) -> tuple[float, int, int]:
        """Mean, least and greatest size of a message, bytes."""
        sizes = [each.size for each in self.samples] or [0]
        return sum(sizes) / len(sizes), min(sizes), max(sizes)


def rate(moments: Sequence[tuple[int, int]]) -> Rate | None:
    """The rate of messages at ``moments``: (time [ns], number lost before it); None when they span no time.

    What happened after the first instant up to the last is counted, what was lost between them as well. Where several
    share an instant, the last one may not be complete yet, and is left out; and what was lost before an instant may
    belong to it or to the one before, so the count then begins and ends where nothing was.
    """
    moments = sorted(moments)
    instants: dict[int, int] = {}
    gaps: dict[int, int] = {}
    for time, lost in moments:
        instants[time] = instants.get(time, 0) + 1 + lost
        gaps[time] = gaps.get(time, 0) + lost
    times = list(instants)
    if len(moments) > len(instants) and len(times) > 2:
        ends = [before for before, after in pairwise(times) if not gaps[after]]
        times = times[times.index(ends[0]) : times.index(ends[-1]) + 1] if len(ends) > 1 else times[:-1]
    if len(times) < 2:
        return None
    span = (times[-1] - times[0]) / SECOND
    count = sum(instants[each] for each in times[1:])
    apart = [(b[0] - a[0]) / SECOND for a, b in pairwise(moments) if not b[1]]
    mean = sum(apart) / len(apart) if apart else 0.0
    spread = math.sqrt(sum((each - mean) ** 2 for each in apart) / len(apart)) if apart else 0.0
    return Rate(count / span, span, count, min(apart, default=0.0), max(apart, default=0.0), spread)
