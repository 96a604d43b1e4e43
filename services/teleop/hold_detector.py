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

MIN_HUMAN_INTERVAL_S = 0.06
"""No finger strikes one key twice within this: a closer event is a repeat."""
MAX_REPEAT_INTERVAL_S = 0.11
"""Two in a row within this are repeats; the Linux console's default is 92 ms."""
BURST_S = 0.004
"""Events within this came in one piece, after a stall, and tell nothing of the keyboard."""
MIN_REPEAT_TIMEOUT_S = 0.1
"""A repeat counts for at least this long: what a busy machine or a network may hold the next one up."""
TIMEOUT_INTERVALS = 3
"""The time-out in mean intervals of repeats."""
LONGEST_INTERVAL_FACTOR = 1.5
"""And at least this much of the longest interval lately, for repeats that come in bursts."""
KEPT_INTERVALS = 8
"""Intervals kept."""
DELAY_MARGIN_S = 0.1
"""A first event counts for so much longer than the delay that was learned."""
MAX_DELAY_S = 2.0
"""An event later than this after the first one is no repeat of it."""


@dataclass(frozen=True)
class HoldDetector:
    """What is known of the keyboard, and of the key that was struck last.

    ``first`` [s] is how long a first event counts. ``key`` was struck last at ``last``, after the two ``gaps`` since
    its events before; ``intervals`` are those between repeats, empty until repeats are seen. The key counts as held
    until ``until``, inclusive. Unless ``adaptive``, every event counts for ``first``.
    """

    first_timeout: float
    adaptive: bool = True
    key: str = ""
    last_time: float = -inf
    gaps: tuple[float, float] = (inf, inf)
    intervals: tuple[float, ...] = ()
    held_until: float = -inf

    def is_held(self, now: float) -> bool:
        """Whether the key counts as held."""
        return now <= self.held_until


def pressed(man: HoldDetector, key: str, at: float, stall: float = 0.0) -> HoldDetector:
    """The switch after an event of ``key`` at ``at`` [s]; the first one of another key begins anew.

    A reader that was held up cannot tell when in the last ``stall`` [s] the event came; the doubt favours a repeat.
    """
    gap = at - man.last_time if key == man.key else inf
    if man.adaptive and _is_repeat(man, gap, at - stall):
        first = man.first_timeout if man.intervals else _learned_timeout(man, gap)
        intervals = (*man.intervals, max(0.0, gap - stall))[-KEPT_INTERVALS:]
        until = at + min(first, _repeat_timeout(intervals))
        return replace(man, first_timeout=first, last_time=at, intervals=intervals, held_until=until)
    if gap < BURST_S:
        return replace(man, last_time=at, held_until=at + man.first_timeout)
    return replace(man, key=key, last_time=at, gaps=(man.gaps[1], gap), intervals=(), held_until=at + man.first_timeout)


def reset(man: HoldDetector) -> HoldDetector:
    """The switch once the key counts no more; what was learned of the keyboard stays."""
    return HoldDetector(man.first_timeout, man.adaptive)


def _is_repeat(man: HoldDetector, gap: float, earliest: float) -> bool:
    """Whether an event ``gap`` after the last one, that came at ``earliest`` or later, is the keyboard's doing."""
    if man.intervals and gap < inf:
        return earliest <= man.held_until
    return BURST_S <= gap <= MIN_HUMAN_INTERVAL_S or max(gap, man.gaps[1]) <= MAX_REPEAT_INTERVAL_S


def _learned_timeout(man: HoldDetector, gap: float) -> float:
    """How long a first event counts from now on [s], as repeats are seen for the first time in this hold.

    The event before the repeats was the delayed one. A longer delay counts at once, a shorter one by half: the first
    event may have been read late.
    """
    delay = man.gaps[1] if gap <= MIN_HUMAN_INTERVAL_S else man.gaps[0]
    if not MAX_REPEAT_INTERVAL_S < delay <= MAX_DELAY_S:
        return man.first_timeout
    wanted = delay + DELAY_MARGIN_S
    return max(wanted, (man.first_timeout + wanted) / 2)


def _repeat_timeout(intervals: tuple[float, ...]) -> float:
    """The time-out after a repeat, s."""
    return max(
        MIN_REPEAT_TIMEOUT_S,
        TIMEOUT_INTERVALS * sum(intervals) / len(intervals),
        LONGEST_INTERVAL_FACTOR * max(intervals),
    )
