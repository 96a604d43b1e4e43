"""Maps wall time to simulation time, from the samples of ``/clock``, each of which has both."""

from __future__ import annotations

from bisect import bisect_left, bisect_right


class ClockMap:
    """The send time of each clock sample by its sender's wall clock [ns], and its simulation time [ns].

    Samples of one sender arrive in order. If one seems older than its predecessors, the wall clock was set back, or a
    predecessor had a wrong stamp: all samples at or after it are dropped, and the map is correct again.
    """

    def __init__(self, kept: int) -> None:
        """Create a map that keeps at least ``kept`` samples, and at most twice as many."""
        self._kept = kept
        self._sent: list[int] = []
        self._times: list[int | None] = []

    def clear(self) -> None:
        """Forget all samples: simulation time was reset."""
        self._sent, self._times = [], []

    def add(self, sent: int, time: int) -> bool:
        """Add a clock sample (both times in ns); returns whether the wall clock was set back."""
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
        """Mark a lost sample after the last one: from the last to the next one, simulation time is unknown."""
        if self._times:
            self._times[-1] = None

    def past(self, moment: int) -> bool:
        """Return whether a clock sample later than ``moment`` [ns] is known, so that no extrapolation is needed."""
        return bool(self._sent) and self._sent[-1] > moment

    def before(self, moment: int) -> int | None:
        """Return the simulation time [ns] of the last sample at or before a moment [ns]; None if there is none or one
        was lost."""
        place = bisect_right(self._sent, moment)
        return self._times[place - 1] if place else None

    def between(self, moment: int) -> int | None:
        """Return the simulation time [ns] at a moment [ns], interpolated linearly between two samples.

        Before the first sample it is that sample's time; after the last one, and where one was lost, None.
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
