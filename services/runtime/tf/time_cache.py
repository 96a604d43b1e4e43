"""The time cache of one moving frame: its recent transforms in the order of their stamps."""

from __future__ import annotations

from bisect import bisect_left
from typing import Literal, NamedTuple

from messages.se3 import Pose3
from services.runtime.errors import Extrapolation

MAX_SAMPLES = 16_384
"""Maximum samples of one frame: ten seconds at more than 1 kHz. A sender that floods loses its own oldest ones."""

Verdict = Literal["taken", "old", "repeated"]


class StampedTransform(NamedTuple):
    """A transform: the parent frame, and the child's pose in it."""

    parent: str
    transform: Pose3


class TimeCache:
    """The transforms of the frame ``child`` over ``cache_ns`` [ns]."""

    def __init__(self, child: str, cache_ns: int) -> None:
        self._child, self._cache_ns = child, cache_ns
        self._stamps: list[int] = []
        self._links: list[StampedTransform] = []

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def newest(self) -> int:
        """The newest stamp [ns]."""
        return self._stamps[-1]

    @property
    def oldest(self) -> int:
        """The oldest stamp kept [ns]."""
        return self._stamps[0]

    def add(self, stamp: int, link: StampedTransform) -> Verdict:
        """Add a transform; it is ``old`` if it precedes the cache, ``repeated`` if its stamp [ns] is already there."""
        stamps = self._stamps
        if not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            self._links.append(link)
            self._forget()
            return "taken"
        if stamp < stamps[-1] - self._cache_ns:
            return "old"
        place = bisect_left(stamps, stamp)
        if stamps[place] == stamp:
            return "repeated"
        stamps.insert(place, stamp)
        self._links.insert(place, link)
        self._forget()
        return "taken"

    def parent(self, time: int | None) -> str:
        """Return the parent at a time [ns], by default the latest; outside the cache, that of the nearest sample."""
        if time is None or time >= self._stamps[-1]:
            return self._links[-1].parent
        return self._links[max(0, bisect_left(self._stamps, time + 1) - 1)].parent

    def at(self, time: int) -> StampedTransform:
        """Return the transform at a time [ns], interpolated between two samples; raises Extrapolation.

        Between two samples with different parents, the earlier one applies.
        """
        stamps = self._stamps
        if not stamps[0] <= time <= stamps[-1]:
            raise self._outside(time)
        place = bisect_left(stamps, time)
        after = self._links[place]
        if stamps[place] == time:
            return after
        before, began = self._links[place - 1], stamps[place - 1]
        if before.parent != after.parent:
            return before
        share = (time - began) / (stamps[place] - began)
        return StampedTransform(before.parent, before.transform.interpolate(after.transform, share))

    def _forget(self) -> None:
        """Drop transforms older than ``cache_ns``, and the oldest beyond MAX_SAMPLES."""
        stamps, oldest = self._stamps, self._stamps[-1] - self._cache_ns
        if stamps[0] >= oldest and len(stamps) <= MAX_SAMPLES:
            return
        count = max(bisect_left(stamps, oldest), len(stamps) - MAX_SAMPLES)
        del stamps[:count]
        del self._links[:count]

    def _outside(self, time: int) -> Extrapolation:
        first, last = self._stamps[0] / 1e9, self._stamps[-1] / 1e9
        past = time < self._stamps[0]
        known = f"only {first:.3f} s is known" if first == last else f"{first:.3f} to {last:.3f} s is known"
        cause = (
            f"the past is kept for {self._cache_ns / 1e9:g} s"
            if past
            else "ask for an earlier time, or omit the time to get the latest transform"
        )
        return Extrapolation(
            f"frame {self._child!r} at {time / 1e9:.3f} s would be extrapolated into the {'past' if past else 'future'}"
            f" by {(self._stamps[0] - time if past else time - self._stamps[-1]) / 1e9:.3f} s: {known}; {cause}"
        )
