"""Guidance laws: stopping speed, turn rate, line-of-sight heading and slew-rate limits."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.se2 import Pose2, Twist2

STANDSTILL = Twist2(0.002, 0.02)
"""Measured speeds below which a robot counts as standing."""


class Segment(NamedTuple):
    """The straight line from (x0, y0) to (x1, y1), m."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def length(self) -> float:
        """Length [m]."""
        return math.hypot(self.x1 - self.x0, self.y1 - self.y0)

    @property
    def heading(self) -> float:
        """Direction of travel [rad]."""
        return math.atan2(self.y1 - self.y0, self.x1 - self.x0)

    def remaining_and_offset(self, here: Pose2) -> tuple[float, float]:
        """Return the distance to the segment's end along it [m], negative past it, and the offset to its left [m]."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        dx, dy = here.x - self.x1, here.y - self.y1
        return -(dx * c + dy * s), dy * c - dx * s

    def distance_to_end(self, here: Pose2) -> float:
        """Return the straight-line distance to the end [m]."""
        return math.hypot(self.x1 - here.x, self.y1 - here.y)


def stopping_speed(remaining: float, max_speed: float, deceleration: float, lag: float) -> float:
    """Return the highest speed that still stops within ``remaining``, at most ``max_speed``.

    It solves remaining = v^2 / (2 deceleration) + v lag for v: constant deceleration far away, and an exponential
    approach with the time constant ``lag`` at the end, so that the loop's delay causes no overshoot.

    Args:
        remaining: Remaining distance [m or rad].
        max_speed: Maximum speed [m/s or rad/s].
        deceleration: Deceleration [m/s^2 or rad/s^2].
        lag: Time constant of the final approach [s].
    """
    if remaining <= 0:
        return 0.0
    soft = deceleration * lag
    return min(max_speed, math.sqrt(soft * soft + 2 * deceleration * remaining) - soft)


def turn_rate(error: float, max_speed: float, acceleration: float, lag: float) -> float:
    """Return the turn rate [rad/s] that corrects a heading ``error`` [rad] and comes to rest there."""
    return math.copysign(stopping_speed(abs(error), max_speed, acceleration, lag), error)


def line_of_sight_heading(segment: Segment, here: Pose2, lookahead: float) -> float:
    """Return the heading [rad] back onto the segment within a ``lookahead`` [m]: heading - atan(offset / lookahead).

    It never points away from the segment's end: both the remaining distance and the offset decrease along it.
    """
    _, offset = segment.remaining_and_offset(here)
    return segment.heading - math.atan(offset / lookahead)


def limit_slew(last: Twist2, target: Twist2, rise: float, fall: float, spin: float) -> Twist2:
    """Return ``target``, at most ``rise`` [m/s] above, ``fall`` [m/s] below and ``spin`` [rad/s] off ``last``."""
    return Twist2(
        max(last.v - fall, min(last.v + rise, target.v)),
        max(last.w - spin, min(last.w + spin, target.w)),
    )
