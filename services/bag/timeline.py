"""Where each message of a bag lies on one timeline, though its simulated time may begin anew."""

from __future__ import annotations

from typing import NamedTuple

JUMP_NS = 1_000_000_000
"""When time falls back by more, it has begun anew; less is a message that came late."""
GAP_NS = 24 * 3600 * 1_000_000_000
"""When it goes on by more, it has begun anew as well: a message without a time before one with, or a damaged time."""


class Moment(NamedTuple):
    """``position`` [ns] from the start of the bag; simulated ``time`` [ns]; how often that began anew: ``segment``."""

    position: int
    segment: int
    time: int


class Timeline:
    """Places messages in the order of their recording; positions never fall."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._position = self._segment = 0
        self._epoch: int | None = None

    def place(self, time: int, epoch: int | None = None) -> Moment:
        """The moment of a message of simulated ``time`` [ns]; ``epoch`` is known of the clock's own messages."""
        if self._last is None:
            self._last = time
        if not self._last - JUMP_NS <= time <= self._last + GAP_NS:
            self._begin(time)
            self._epoch = None
        elif epoch is not None and self._epoch is not None and epoch != self._epoch:
            self._begin(time)
        elif time > self._last:
            self._position += time - self._last
            self._last = time
        self._epoch = epoch if epoch is not None else self._epoch
        return Moment(self._position, self._segment, self._last)

    def _begin(self, time: int) -> None:
        self._segment += 1
        self._last = time
