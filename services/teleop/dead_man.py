"""The dead-man's switch: how long a key counts as held, on a keyboard that tells of presses and repeats but not of ups.

A key that is held down sends its first event at once, the next after a delay (0.25 to 1 s), then one every 17 to
100 ms. Any one time-out is wrong: shorter than the delay, a held key stutters; longer, a released key drives on. So a
first event counts for longer than the delay, and once repeats are seen the time-out is three of their intervals. The
delay is learned from every hold, so that the next first event counts for long enough, and for no longer than it must.

All times are seconds on one clock, the one that the hand lives by.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

FASTEST_HAND_S = 0.06
"""No finger strikes one key twice within this: a closer event is a repeat."""
SLOWEST_REPEAT_S = 0.11
"""Two in a row within this are repeats; the Linux console's default is 92 ms."""
BURST_S = 0.004
"""Events within this came in one piece, after a stall, and tell nothing of the keyboard."""
LEAST_S = 0.1
"""A repeat counts for at least this long: what a busy machine or a network may hold the next one up."""
INTERVALS = 3
"""The time-out in mean intervals of repeats."""
WORST = 1.5
"""And at least this much of the longest interval lately, for repeats that come in bursts."""
MEMORY = 8
"""Intervals kept."""
MARGIN_S = 0.1
"""A first event counts for so much longer than the delay that was learned."""
LONGEST_DELAY_S = 2.0
"""An event later than this after the first one is no repeat of it."""


@dataclass(frozen=True)
class DeadMan:
    """What is known of the keyboard, and of the key that was struck last.

    ``first`` [s] is how long a first event counts. ``key`` was struck last at ``last``, after the two ``gaps`` since
    its events before; ``intervals`` are those between repeats, empty until repeats are seen. The key counts as held
    until ``until``, inclusive. Unless ``adaptive``, every event counts for ``first``.
    """

    first: float
    adaptive: bool = True
    key: str = ""
    last: float = -inf
    gaps: tuple[float, float] = (inf, inf)
    intervals: tuple[float, ...] = ()
    until: float = -inf

    def holds(self, now: float) -> bool:
        """Whether the key counts as held."""
        return now <= self.until


def struck(man: DeadMan, key: str, at: float, stall: float = 0.0) -> DeadMan:
    """The switch after an event of ``key`` at ``at`` [s]; the first one of another key begins anew.

    A reader that was held up cannot tell when in the last ``stall`` [s] the event came; the doubt favours a repeat.
    """
    gap = at - man.last if key == man.key else inf
    if man.adaptive and _repeats(man, gap, at - stall):
        first = man.first if man.intervals else _learned(man, gap)
        intervals = (*man.intervals, max(0.0, gap - stall))[-MEMORY:]
        until = at + min(first, _allowance(intervals))
        return replace(man, first=first, last=at, intervals=intervals, until=until)
    if gap < BURST_S:
        return replace(man, last=at, until=at + man.first)
    return replace(man, key=key, last=at, gaps=(man.gaps[1], gap), intervals=(), until=at + man.first)


def released(man: DeadMan) -> DeadMan:
    """The switch once the key counts no more; what was learned of the keyboard stays."""
    return DeadMan(man.first, man.adaptive)


def _repeats(man: DeadMan, gap: float, earliest: float) -> bool:
    """Whether an event ``gap`` after the last one, that came at ``earliest`` or later, is the keyboard's doing."""
    if man.intervals and gap < inf:
        return earliest <= man.until
    return BURST_S <= gap <= FASTEST_HAND_S or max(gap, man.gaps[1]) <= SLOWEST_REPEAT_S


def _learned(man: DeadMan, gap: float) -> float:
    """How long a first event counts from now on [s], as repeats are seen for the first time in this hold.

    The event before the repeats was the delayed one. A longer delay counts at once, a shorter one by half: the first
    event may have been read late.
    """
    delay = man.gaps[1] if gap <= FASTEST_HAND_S else man.gaps[0]
    if not SLOWEST_REPEAT_S < delay <= LONGEST_DELAY_S:
        return man.first
    wanted = delay + MARGIN_S
    return max(wanted, (man.first + wanted) / 2)


def _allowance(intervals: tuple[float, ...]) -> float:
    """The time-out after a repeat, s."""
    return max(LEAST_S, INTERVALS * sum(intervals) / len(intervals), WORST * max(intervals))
