"""Dead-man's switch: detects how long a key is held on a keyboard that reports presses and repeats, but no releases.

A held key sends its first event at once, the next after a delay (0.25 to 1 s), then one every 17 to 100 ms. No single
time-out fits: if shorter than the delay, a held key stutters; if longer, a released key drives on. Therefore the first
event counts for longer than the delay, and once repeats are seen, the time-out is three of their intervals. The delay
is learned from each hold, so that the next first event counts for just long enough.

All times are in seconds of one clock, the wall clock for a human.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

MIN_HUMAN_INTERVAL_S = 0.06
"""Minimum time between two presses of one key; a closer event is a repeat."""
MAX_REPEAT_INTERVAL_S = 0.11
"""Two intervals in a row within this are repeats; the Linux console's default is 92 ms."""
BURST_S = 0.004
"""Events within this arrived together after a stall, and say nothing about the keyboard."""
MIN_REPEAT_TIMEOUT_S = 0.1
"""Minimum time-out after a repeat: the delay that a busy machine or a network may add to the next one."""
TIMEOUT_INTERVALS = 3
"""Time-out in mean repeat intervals."""
LONGEST_INTERVAL_FACTOR = 1.5
"""Minimum time-out relative to the longest recent interval, for repeats that arrive in bursts."""
KEPT_INTERVALS = 8
"""Number of intervals kept."""
DELAY_MARGIN_S = 0.1
"""Time-out after a first event, relative to the learned delay."""
MIN_DELAY_S = 0.14
"""Shortest delay between a first event and its first repeat; a shorter gap may be one between slow repeats."""
MAX_DELAY_S = 2.0
"""Longest delay between a first event and its first repeat."""


@dataclass(frozen=True)
class HoldDetector:
    """The timing of the keyboard, and the last key.

    Attributes:
        first_timeout: How long a first event counts [s]; every event, unless ``adaptive``.
        adaptive: Learn the keyboard's delay and repeat interval.
        key: The last key.
        last_time: Time of its last event [s], as it was read.
        last_stall: How much earlier that event may have occurred [s].
        gaps: The last two gaps between its events that may be the keyboard's delay [s], at most.
        intervals: Intervals between repeats [s]; empty until repeats are seen.
        held_until: Time [s] until which the key counts as held, inclusive.
    """

    first_timeout: float
    adaptive: bool = True
    key: str = ""
    last_time: float = -inf
    last_stall: float = 0.0
    gaps: tuple[float, float] = (inf, inf)
    intervals: tuple[float, ...] = ()
    held_until: float = -inf

    def is_held(self, now: float) -> bool:
        """Whether the key counts as held."""
        return now <= self.held_until


def pressed(detector: HoldDetector, key: str, at: float, stall: float = 0.0) -> HoldDetector:
    """Return the state after an event of ``key`` at ``at`` [s]; another key restarts the detection.

    A stalled reader cannot tell when in the last ``stall`` [s] the event occurred; in doubt, it counts as a repeat.
    """
    gap = at - detector.last_time if key == detector.key else inf
    if detector.adaptive and _is_repeat(detector, gap, at - stall):
        first = detector.first_timeout if detector.intervals else _learned_timeout(detector)
        intervals = (*detector.intervals, max(0.0, gap - stall))[-KEPT_INTERVALS:]
        until = at + min(first, _repeat_timeout(intervals))
        return replace(
            detector, first_timeout=first, last_time=at, last_stall=stall, intervals=intervals, held_until=until
        )
    until = at + detector.first_timeout
    if gap < BURST_S:
        return replace(detector, last_time=at, last_stall=stall, held_until=until)
    gaps = (inf, inf) if detector.intervals else (detector.gaps[1], gap + detector.last_stall)
    return replace(detector, key=key, last_time=at, last_stall=stall, gaps=gaps, intervals=(), held_until=until)


def reset(detector: HoldDetector) -> HoldDetector:
    """Return the state without a held key; the learned timing stays."""
    return HoldDetector(detector.first_timeout, detector.adaptive)


def _is_repeat(detector: HoldDetector, gap: float, earliest: float) -> bool:
    """Whether an event ``gap`` after the last one, at ``earliest`` or later, is a repeat by the keyboard."""
    if detector.intervals and gap < inf:
        return earliest <= detector.held_until
    return BURST_S <= gap <= MIN_HUMAN_INTERVAL_S or max(gap, detector.gaps[1]) <= MAX_REPEAT_INTERVAL_S


def _learned_timeout(detector: HoldDetector) -> float:
    """Return the new time-out of first events [s], once repeats are seen for the first time in a hold.

    The event before the repeats was the delayed one. A longer delay is adopted at once, a shorter one by half, as the
    first event may have been read late. A last gap shorter than any delay is that of a repeat read late. The gap after
    a repeat is not the delay: the key was released and pressed again, or the repeats stalled. Nothing is learned when
    two gaps may both be the delay: either the key was tapped before it was held, or one of its first repeats was very
    late on a busy machine.
    """
    before, last = detector.gaps
    delay, previous = (last, before) if last >= MIN_DELAY_S else (before, inf)
    if MIN_DELAY_S <= previous <= MAX_DELAY_S or not MIN_DELAY_S <= delay <= MAX_DELAY_S:
        return detector.first_timeout
    timeout = delay + DELAY_MARGIN_S
    return max(timeout, (detector.first_timeout + timeout) / 2)


def _repeat_timeout(intervals: tuple[float, ...]) -> float:
    """Return the time-out after a repeat [s]."""
    return max(
        MIN_REPEAT_TIMEOUT_S,
        TIMEOUT_INTERVALS * sum(intervals) / len(intervals),
        LONGEST_INTERVAL_FACTOR * max(intervals),
    )
