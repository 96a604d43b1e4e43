"""The age of a sample at its arrival, whatever the sender's clock says, and through steps of any clock."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from services.runtime.transport.wire import SampleInfo

SECOND = 1_000_000_000

JUMP_NS = 50_000_000
"""A delay that differs by more from the baseline is a late sample, or a clock that was set."""
CONFIRM_NS = 150_000_000
"""For so long samples must come at the pace at which they were sent before their delay is a new baseline."""
MAX_LOST = 4
"""Numbers that may be missing between two samples of such a proof."""
WINDOW_NS = 10 * SECOND
"""The baseline follows the least delay of the last one or two of these: drift of 100 ppm moves it by 2 ms meanwhile."""
MAX_SENDERS = 1024
"""Maximum number of publishers that are remembered; the one that was silent for longest is forgotten."""


class TransitDelayEstimator:
    """The time that samples were under way: their delay (arrival less the sender's stamp) beyond a baseline.

    The baseline of a publisher is the least delay that it had lately. At first it is 0: the clocks agree, as on one
    machine they do. Where they differ, or when one of them is set, the delay jumps, as it does when samples waited
    in a frozen process or on a link. The two are told apart by pace. What had waited comes all at once; so a delay off
    the baseline becomes the new one only when samples have kept to it for PROOF_NS of a clock that nobody sets, in the
    order of their numbers. Until then a sample that looks late is as old as it looks, and one that looks newer than any
    can be is of unknown age, ``inf``. So a clock that is set, or differs, costs its sender PROOF_NS once.

    It cannot be told from a clock that is set: a link that from now on delays everything by the same time.

    Args:
        wall: The clock by which stamps are made, ns.
        monotonic: A clock that nobody sets, ns.
    """

    def __init__(
        self, wall: Callable[[], int] = time.time_ns, monotonic: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._wall, self._monotonic = wall, monotonic
        self._senders: OrderedDict[bytes, _Sender] = OrderedDict()

    def estimate(self, origin: SampleInfo) -> float:
        """The age of a sample that arrives now, s of wall time; ``inf`` when it is not known."""
        sender = self._senders.get(origin.publisher)
        if sender is None:
            if len(self._senders) >= MAX_SENDERS:
                self._senders.popitem(last=False)
            sender = self._senders[origin.publisher] = _Sender()
        self._senders.move_to_end(origin.publisher)
        return sender.delay(origin.sequence, self._wall() - origin.source_ns, self._monotonic())


@dataclass(slots=True)
class _Candidate:
    """Samples that keep to a delay off the baseline: the first's, the least, when they began, the last's number."""

    first: int
    least: int
    since: int
    last_sequence: int


class _Sender:
    """The baseline of one publisher; all in ns."""

    __slots__ = ("_baseline", "_candidate", "_lower", "_lower_until", "_window_minimum", "_window_start")

    def __init__(self) -> None:
        self._baseline = 0
        self._window_minimum: int | None = None
        """The least delay since ``_since``; the baseline is that of the window before, if it is less."""
        self._window_start = 0
        self._candidate: _Candidate | None = None
        self._lower, self._lower_until = 0, 0
        """The baseline before it rose, for as long as it may come back."""

    def delay(self, number: int, delay: int, now: int) -> float:
        """The age [s] of the sample ``number``, which came at ``now`` with this delay."""
        if now < self._lower_until and self._lower - JUMP_NS <= delay < self._baseline - JUMP_NS:
            self._set_baseline(self._lower)  # not a clock was set, but a machine was busy that is not any more
        if abs(delay - self._baseline) > JUMP_NS and not self._confirmed(number, delay, now):
            return (delay - self._baseline) / SECOND if delay > self._baseline else inf
        self._candidate = None
        self._update_baseline(delay, now)
        return max(0, delay - self._baseline) / SECOND

    def _confirmed(self, number: int, delay: int, now: int) -> bool:
        """Whether samples have kept to this delay for long enough; then it is the baseline."""
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
        """Let the baseline be the least delay of this window and the one before; in a pause it stays."""
        if self._window_minimum is None:
            self._window_minimum, self._window_start = delay, now
        elif now - self._window_start < WINDOW_NS:
            self._window_minimum = min(self._window_minimum, delay)
        else:
            self._baseline = self._window_minimum
            self._window_minimum, self._window_start = delay, now
        self._baseline = min(self._baseline, delay)
