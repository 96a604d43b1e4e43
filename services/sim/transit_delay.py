"""Estimates the age of a sample at its arrival, despite offsets between clocks and steps of any clock."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from services.runtime.transport.wire import SampleInfo

SECOND = 1_000_000_000

JUMP_NS = 50_000_000
"""A delay that differs by more from the baseline means a late sample, or a clock that was set."""
CONFIRM_NS = 150_000_000
"""Samples must arrive at the pace of their stamps for this long before their delay becomes the new baseline."""
MAX_LOST = 4
"""Samples that may be missing between two of those that confirm a new baseline."""
WINDOW_NS = 10 * SECOND
"""The baseline is the smallest delay of the last one or two windows: drift of 100 ppm moves it by 2 ms in that time."""
MAX_SENDERS = 1024
"""Maximum number of publishers remembered; the one silent for longest is forgotten."""


class TransitDelayEstimator:
    """Estimates the transit time of samples: their delay (arrival minus the sender's stamp) above a baseline.

    The baseline of a publisher is its smallest recent delay. It starts at 0: clocks agree, as on one machine. Where
    they differ, or when one is set, the delay jumps; it also jumps when samples waited in a frozen process or on a
    link. The two differ in pace: what had waited arrives all at once. So a delay off the baseline becomes the new one
    only after samples have kept to it for CONFIRM_NS of a monotonic clock, in the order of their sequence numbers.
    Until then a sample that looks late is as old as it looks, and the age of one that looks too new is unknown,
    ``inf``. So a clock that is set, or differs, costs its sender CONFIRM_NS once.

    A link that suddenly delays everything by the same time cannot be distinguished from a clock that was set.

    Args:
        wall: The clock that stamps are made with, ns.
        monotonic: A clock that is never set, ns.
    """

    def __init__(
        self, wall: Callable[[], int] = time.time_ns, monotonic: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._wall, self._monotonic = wall, monotonic
        self._senders: OrderedDict[bytes, _Sender] = OrderedDict()

    def estimate(self, origin: SampleInfo) -> float:
        """Return the age of a sample that arrives now, s of wall time; ``inf`` if it is unknown."""
        sender = self._senders.get(origin.publisher)
        if sender is None:
            if len(self._senders) >= MAX_SENDERS:
                self._senders.popitem(last=False)
            sender = self._senders[origin.publisher] = _Sender()
        self._senders.move_to_end(origin.publisher)
        return sender.delay(origin.sequence, self._wall() - origin.source_ns, self._monotonic())


@dataclass(slots=True)
class _Candidate:
    """A possible new baseline: delay of its first sample, smallest delay, when it began, and the last number."""

    first: int
    least: int
    since: int
    last_sequence: int


class _Sender:
    """The baseline of one publisher; all times in ns."""

    __slots__ = ("_baseline", "_candidate", "_lower", "_lower_until", "_window_minimum", "_window_start")

    def __init__(self) -> None:
        self._baseline = 0
        self._window_minimum: int | None = None
        """The smallest delay since ``_window_start``; the baseline is the previous window's, if that is smaller."""
        self._window_start = 0
        self._candidate: _Candidate | None = None
        self._lower, self._lower_until = 0, 0
        """The baseline before it rose, and until when it may be restored."""

    def delay(self, number: int, delay: int, now: int) -> float:
        """Return the age [s] of the sample ``number`` that arrived at ``now`` with this delay."""
        if now < self._lower_until and self._lower - JUMP_NS <= delay < self._baseline - JUMP_NS:
            self._set_baseline(self._lower)  # no clock was set: a machine was busy, and no longer is
        if abs(delay - self._baseline) > JUMP_NS and not self._confirmed(number, delay, now):
            return (delay - self._baseline) / SECOND if delay > self._baseline else inf
        self._candidate = None
        self._update_baseline(delay, now)
        return max(0, delay - self._baseline) / SECOND

    def _confirmed(self, number: int, delay: int, now: int) -> bool:
        """Return whether samples have kept to this delay for long enough; if so, make it the baseline."""
        proof = self._candidate
        if proof is None or not (
            proof.first - JUMP_NS <= delay <= proof.least + JUMP_NS
            and proof.last_sequence <= number <= proof.last_sequence + MAX_LOST + 1
        ):
            self._candidate = _Candidate(delay, delay, now, number)
            return False
        proof.least, proof.last_sequence = min(proof.least, delay), number
        if now - proof.since < CONFIRM_NS:
            return False
        if proof.least > self._baseline:
            known = now < self._lower_until
            self._lower = min(self._lower, self._baseline) if known else self._baseline
            self._lower_until = now + WINDOW_NS
        self._set_baseline(proof.least)
        return True

    def _set_baseline(self, baseline: int) -> None:
        self._baseline, self._window_minimum = baseline, None

    def _update_baseline(self, delay: int, now: int) -> None:
        """Make the smallest delay of this window and the previous one the baseline; without samples it stays."""
        if self._window_minimum is None:
            self._window_minimum, self._window_start = delay, now
        elif now - self._window_start < WINDOW_NS:
            self._window_minimum = min(self._window_minimum, delay)
        else:
            self._baseline = self._window_minimum
            self._window_minimum, self._window_start = delay, now
        self._baseline = min(self._baseline, delay)
