"""Poses, velocities and straight legs on the ground."""

from __future__ import annotations

import math
from typing import NamedTuple


class Pose2(NamedTuple):
    """A pose: x, y [m], yaw [rad]."""

    x: float
    y: float
    yaw: float = 0.0


class Twist2(NamedTuple):
    """A velocity in the body frame: forward ``v`` [m/s], turn ``w`` [rad/s]."""

    v: float = 0.0
    w: float = 0.0


ZERO_TWIST = Twist2()


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi]."""
    return math.remainder(angle, math.tau)


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


class Transform2(NamedTuple):
    """Where a frame lies in another one: the planar transform p' = R(yaw) p + (x, y); ``c`` and ``s`` are R's."""

    c: float = 1.0
    s: float = 0.0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @classmethod
    def aligning(cls, there: Pose2, here: Pose2) -> Transform2:
        """The transform that lays the pose ``here`` of one frame over the same pose ``there``, told in the other."""
        yaw = there.yaw - here.yaw
        c, s = math.cos(yaw), math.sin(yaw)
        return cls(c, s, there.x - (c * here.x - s * here.y), there.y - (s * here.x + c * here.y), yaw)

    def apply(self, pose: Pose2) -> Pose2:
        """A pose told in the other frame; the yaw is not wrapped."""
        return Pose2(
            self.c * pose.x - self.s * pose.y + self.x,
            self.s * pose.x + self.c * pose.y + self.y,
            pose.yaw + self.yaw,
        )


IDENTITY = Transform2()
"""A frame that lies in itself."""
