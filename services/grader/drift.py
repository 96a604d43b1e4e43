"""Odometry against ground truth."""

from __future__ import annotations

import math

from messages.geometry import Pose
from messages.nav import Odometry
from services.motion.planar import HERE, Placement, Planar, wrap

NOWHERE = Planar(math.nan, math.nan, math.nan)


class Drift:
    """Places the frame of the odometry in the world where the first two samples of one stamp agree, then compares.

    World odometry lies there already; wheel odometry starts wherever it was reset. Distances in m, headings in rad.
    """

    def __init__(self) -> None:
        self.largest: float | None = None
        self.last: float | None = None
        self.turned_most: float | None = None
        self.turned: float | None = None
        self._sample: Odometry | None = None
        self._frame: Placement | None = None

    @property
    def frame(self) -> Placement:
        """Where the frame of the odometry lies in the world; the world itself as long as there is no odometry."""
        return self._frame or HERE

    def take(self, sample: Odometry) -> None:
        """Keep an odometry sample for the ground truth of its stamp."""
        self._sample = sample

    def compare(self, stamp: int, truth: Pose) -> Planar:
        """The pose in the world that odometry gives at ``stamp`` [ns]; NOWHERE when it has no sample of then."""
        if self._sample is None or self._sample.header.stamp.ns != stamp:
            return NOWHERE
        here, there = planar(self._sample.pose.pose), planar(truth)
        if self._frame is None:
            self._frame = Placement.of(there, here)
        world = self._frame.apply(here)
        self.last = math.hypot(world.x - there.x, world.y - there.y)
        self.largest = max(self.largest or 0.0, self.last)
        self.turned = abs(wrap(world.yaw - there.yaw))
        self.turned_most = max(self.turned_most or 0.0, self.turned)
        return world


def planar(pose: Pose) -> Planar:
    """A pose on the ground."""
    return Planar(pose.position.x, pose.position.y, pose.orientation.yaw)
