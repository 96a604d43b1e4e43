"""Guidance of a ground robot: legs, the heading back onto one, speeds that stop in time, and slew limits."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.se2 import Pose2, Twist2


class Segment(NamedTuple):
    """The straight line from (x0, y0) to (x1, y1), m."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def length(self) -> float:
        """Metres from start to end."""
        return math.hypot(self.x1 - self.x0, self.y1 - self.y0)

    @property
    def heading(self) -> float:
        """Direction of travel, rad."""
        return math.atan2(self.y1 - self.y0, self.x1 - self.x0)

    def remaining_and_offset(self, here: Pose2) -> tuple[float, float]:
        """Distance left along the leg, negative past its end, and offset to the left of it, both m."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        dx, dy = here.x - self.x1, here.y - self.y1
        return -(dx * c + dy * s), dy * c - dx * s

    def distance_to_end(self, here: Pose2) -> float:
        """Straight distance to the end, m."""
        return math.hypot(self.x1 - here.x, self.y1 - here.y)


def stopping_speed(left: float, top: float, deceleration: float, lag: float) -> float:
    """The highest speed from which ``left`` can still be braked, at most ``top``.

    It solves left = v^2 / (2 deceleration) + v lag for v: the parabola of constant deceleration far out, an exponential
    approach of time constant ``lag`` [s] at the end, so that the loop's delay causes no overshoot. Serves metres and
    radians alike.
    """
    if left <= 0:
        return 0.0
    soft = deceleration * lag
    return min(top, math.sqrt(soft * soft + 2 * deceleration * left) - soft)


def turn_rate(error: float, top: float, acceleration: float, lag: float) -> float:
    """Turn rate [rad/s] that takes out a heading ``error`` [rad] and comes to rest there."""
    return math.copysign(stopping_speed(abs(error), top, acceleration, lag), error)


def line_of_sight_heading(leg: Segment, here: Pose2, lookahead: float) -> float:
    """Heading [rad] that leads back onto the leg within about ``lookahead`` [m]: heading - atan(offset / lookahead).

    It never points away from the end of the leg: both the distance left and the offset shrink along it.
    """
    _, offset = leg.remaining_and_offset(here)
    return leg.heading - math.atan(offset / lookahead)


def limit_slew(last: Twist2, wanted: Twist2, rise: float, fall: float, spin: float) -> Twist2:
    """``wanted``, at most ``rise`` [m/s] above, ``fall`` [m/s] below and ``spin`` [rad/s] off the ``last`` command."""
    return Twist2(
        max(last.v - fall, min(last.v + rise, wanted.v)),
        max(last.w - spin, min(last.w + spin, wanted.w)),
    )
