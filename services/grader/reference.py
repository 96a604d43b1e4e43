"""The reference path of a robot: straight legs from its start through its goals."""

from __future__ import annotations

import math

Point = tuple[float, float]


def segment_distance(a: Point, b: Point, x: float, y: float) -> float:
    """Distance [m] of (x, y) to the segment from ``a`` to ``b``, beyond its ends to the nearer end."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    dx, dy = x - a[0], y - a[1]
    square = ux * ux + uy * uy
    share = max(0.0, min(1.0, (dx * ux + dy * uy) / square)) if square > 0 else 0.0
    return math.hypot(dx - share * ux, dy - share * uy)


class Reference:
    """``corners``: the start and then the goals, m. Leg k leads to goal k, from corner k to corner k + 1."""

    def __init__(self, start: Point, goals: tuple[Point, ...]) -> None:
        self.goals = goals
        self.corners: tuple[Point, ...] = (start, *goals)

    def cross_track(self, index: int, x: float, y: float) -> float:
        """Distance [m] to the path for a robot on its way to goal ``index``.

        Only the leg to that goal and the one before count, the nearer of the two: who cuts a corner or turns on a point
        is measured against the corner, and a crossing with a later leg hides nothing.
        """
        here = segment_distance(self.corners[index], self.corners[index + 1], x, y)
        if index == 0:
            return here
        return min(here, segment_distance(self.corners[index - 1], self.corners[index], x, y))
