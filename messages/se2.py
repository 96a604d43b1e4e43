"""Planar poses and velocities: composition, inverse, difference; plain arithmetic, in metres and radians."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.geometry import Pose, Transform, Twist


class Pose2(NamedTuple):
    """The pose of a frame in its parent: x, y [m] and yaw [rad], which no operation wraps.

    It is also the transform from the frame to its parent: a point p becomes R(yaw) p + (x, y) in the parent.
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @classmethod
    def from_msg(cls, message: Pose | Transform) -> Pose2:
        """Return the planar part of a pose or transform."""
        if isinstance(message, Pose):
            return cls(message.position.x, message.position.y, message.orientation.yaw)
        return cls(message.translation.x, message.translation.y, message.rotation.yaw)

    @classmethod
    def aligning(cls, there: Pose2, here: Pose2) -> Pose2:
        """Return the transform that maps ``here``, a pose in one frame, to ``there``, the same pose in another."""
        yaw = there.yaw - here.yaw
        c, s = math.cos(yaw), math.sin(yaw)
        return cls(there.x - (c * here.x - s * here.y), there.y - (s * here.x + c * here.y), yaw)

    def to_msg(self) -> Pose:
        """Return the pose as a message, at z = 0."""
        return Pose.planar(self.x, self.y, self.yaw)

    def compose(self, inner: Pose2) -> Pose2:
        """Transform ``inner`` from this frame to its parent; also written ``self @ inner``."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(
            c * inner.x - s * inner.y + self.x,
            s * inner.x + c * inner.y + self.y,
            inner.yaw + self.yaw,
        )

    def __matmul__(self, inner: Pose2) -> Pose2:
        return self.compose(inner)

    def inverse(self) -> Pose2:
        """Return the pose of the parent in this frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)

    def between(self, there: Pose2) -> Pose2:
        """Transform ``there`` from the parent to this frame: ``self @ self.between(there)`` is ``there``."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = there.x - self.x, there.y - self.y
        return Pose2(c * dx + s * dy, c * dy - s * dx, there.yaw - self.yaw)

    @property
    def wrapped(self) -> Pose2:
        """The same pose with its yaw in [-pi, pi]."""
        return self._replace(yaw=wrap(self.yaw))


class Twist2(NamedTuple):
    """A velocity in the body frame: forward ``v`` [m/s], turn ``w`` [rad/s]."""

    v: float = 0.0
    w: float = 0.0

    @classmethod
    def from_msg(cls, twist: Twist) -> Twist2:
        """Return the planar part of a twist."""
        return cls(twist.linear.x, twist.angular.z)

    def to_msg(self) -> Twist:
        """Return the velocity as a message."""
        return Twist.planar(self.v, self.w)


IDENTITY = Pose2()
"""The pose of a frame in itself."""
ZERO_TWIST = Twist2()


def wrap(angle: float) -> float:
    """Wrap an angle [rad] to [-pi, pi]."""
    return math.remainder(angle, math.tau)
