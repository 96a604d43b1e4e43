"""A robot's reference path: its distance from the current segment, and from the goal at its end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


def distance_to_segments(points: Floats, begins: Floats, ends: Floats) -> Floats:
    """Return the distances [m], shape (n,), of points (n, 2) from the segments begins-ends, each (n, 2)."""
    segments = ends - begins
    squares = np.einsum("ij,ij->i", segments, segments)
    along = np.einsum("ij,ij->i", points - begins, segments) / np.where(squares > 0, squares, 1.0)
    nearest = begins + np.clip(along, 0.0, 1.0)[:, None] * segments
    off: Floats = np.hypot(*(points - nearest).T)
    return off


class ReferencePath:
    """A plan from ``start`` (2,) through ``goals`` (n, 2), both in the world [m], valid from ``since`` [ns] on."""

    def __init__(self, since: int, start: Floats, goals: Floats) -> None:
        self.points = np.vstack((start, goals))
        self._last = len(goals)
        self._since = [since]
        self._segments = [(0, 1)]

    def set_goal(self, time: int, index: int) -> None:
        """Set the goal from ``time`` [ns] on; a new lap starts at the last goal."""
        end = min(index + 1, self._last)
        begun_before = any(each != (0, 1) for each in self._segments)
        segment = (self._last if end == 1 and begun_before else end - 1, end)
        if segment != self._segments[-1]:
            self._since.append(max(time, self._since[-1]))
            self._segments.append(segment)

    def goal(self, index: int) -> tuple[float, float]:
        """Return the goal ``index`` in the world [m]; the last one for a larger index."""
        x, y = self.points[min(index + 1, self._last)]
        return float(x), float(y)

    def errors(self, times: Stamps, positions: Floats) -> tuple[Floats, Floats]:
        """Return cross-track error and goal distance [m], each (n,), of positions (n, 2); NaN before the plan."""
        at = np.searchsorted(self._since, times, side="right") - 1
        segments = np.array(self._segments)[np.maximum(at, 0)]
        begins, ends = self.points[segments[:, 0]], self.points[segments[:, 1]]
        cross_track = distance_to_segments(positions, begins, ends)
        distance = np.hypot(*(positions - ends).T)
        early = at < 0
        cross_track[early] = distance[early] = np.nan
        return cross_track, distance

    def trim(self, time: int) -> None:
        """Drop the segments that ended before ``time`` [ns]; earlier times must not be queried again."""
        keep = max(0, int(np.searchsorted(self._since, time, side="right")) - 1)
        del self._since[:keep], self._segments[:keep]
