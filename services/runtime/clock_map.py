"""Maps wall time to simulation time by the samples of ``/clock``, each of which has both."""

from __future__ import annotations

from bisect import bisect_left, bisect_right


class ClockMap:
    """The send time of each clock sample by its sender's wall clock [ns], and its simulation time [ns].

    Samples of one sender arrive in order. One that seems to be older than its predecessors means that the wall clock
    was set back, or that a predecessor had a wrong stamp: all at or after it are dropped, and the map is correct again.
    """

    def __init__(self, kept: int) -> None:
        """``kept`` clocks are remembered at least, and twice as many at most."""
        self._kept = kept
        self._sent: list[int] = []
        self._times: list[int | None] = []

    def clear(self) -> None:
        """Forget all samples: simulation time was reset."""
        self._sent, self._times = [], []

    def add(self, sent: int, time: int) -> bool:
        """Take a clock; whether the wall clock was set back."""
        set_back = bool(self._sent) and sent < self._sent[-1]
        if self._sent and sent <= self._sent[-1]:
            place = bisect_left(self._sent, sent)
            del self._sent[place:], self._times[place:]
        self._sent.append(sent)
        self._times.append(time)
        if len(self._sent) > 2 * self._kept:
            del self._sent[: -self._kept], self._times[: -self._kept]
        return set_back

    def lose(self) -> None:
        """A clock was lost after the last one: from then until the next one, time is unknown."""
        if self._times:
            self._times[-1] = None

    def past(self, moment: int) -> bool:
        """Whether a later clock sample is known, so that the simulation time is interpolated, not extrapolated."""
        return bool(self._sent) and self._sent[-1] > moment

    def before(self, moment: int) -> int | None:
        """The last clock sent before a moment; None before the first, and where one was lost."""
        place = bisect_right(self._sent, moment)
        return self._times[place - 1] if place else None

    def between(self, moment: int) -> int | None:
        """Simulation time at a moment, by proportion between two clocks; that of the first one before it.

        None after the last clock, and where one was lost.
        """
        place = bisect_right(self._sent, moment)
        if place == len(self._sent):
            return None
        if place == 0:
            return self._times[0]
        (sent, time), (next_sent, next_time) = ((self._sent[each], self._times[each]) for each in (place - 1, place))
        if time is None or next_time is None:
            return None
        return time + round((moment - sent) / (next_sent - sent) * (next_time - time))
