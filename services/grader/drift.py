"""Odometry against ground truth."""

from __future__ import annotations

import math

from messages.geometry import Pose
from messages.nav import Odometry


class Drift:
    """Places the frame of the odometry in the world where the first two samples of one stamp agree, then compares.

    World odometry lies there already; wheel odometry starts wherever it was reset.
    """

    def __init__(self) -> None:
        self.largest: float | None = None
        self.last: float | None = None
        self._sample: Odometry | None = None
        self._frame: tuple[float, float, float, float] | None = None

    def take(self, sample: Odometry) -> None:
        """Keep an odometry sample for the ground truth of its stamp."""
        self._sample = sample

    def compare(self, stamp: int, truth: Pose) -> tuple[float, float]:
        """The position [m] in the world that odometry gives at ``stamp`` [ns]; nan when it has no sample of then."""
        if self._sample is None or self._sample.header.stamp.ns != stamp:
            return math.nan, math.nan
        pose = self._sample.pose.pose
        x, y = pose.position.x, pose.position.y
        if self._frame is None:
            turned = truth.orientation.yaw - pose.orientation.yaw
            c, s = math.cos(turned), math.sin(turned)
            self._frame = c, s, truth.position.x - (c * x - s * y), truth.position.y - (s * x + c * y)
        c, s, dx, dy = self._frame
        world = c * x - s * y + dx, s * x + c * y + dy
        self.last = math.hypot(world[0] - truth.position.x, world[1] - truth.position.y)
        self.largest = max(self.largest or 0.0, self.last)
        return world
