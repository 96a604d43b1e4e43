"""Static transforms the logger needs: where odometry frames and lasers lie."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from messages.se3 import IDENTITY, SE3
from services.runtime.errors import NoTransform
from services.runtime.tf.buffer import TransformBuffer

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Transform2:
    """The planar transform p_world = R(yaw) p_odom + (x, y); m and rad."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @classmethod
    def from_poses(cls, truth: tuple[float, float, float], odometry: tuple[float, float, float]) -> Transform2:
        """The transform that lays an odometry pose over the true pose of the same instant; both are (x, y, yaw)."""
        yaw = math.remainder(truth[2] - odometry[2], math.tau)
        c, s = math.cos(yaw), math.sin(yaw)
        return cls(
            x=truth[0] - c * odometry[0] + s * odometry[1],
            y=truth[1] - s * odometry[0] - c * odometry[1],
            yaw=yaw,
        )

    def apply(self, points: Floats) -> Floats:
        """Points of shape (n, 2) [m], taken from the odometry's frame to the world."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y = points[:, 0], points[:, 1]
        return np.column_stack((c * x - s * y + self.x, s * x + c * y + self.y))


WORLD = "world"


def world_transform(frames: TransformBuffer, frame: str) -> Transform2 | None:
    """Where a frame lies in the world, on the ground; None when ``/tf_static`` does not tell."""
    if frame in ("", WORLD):
        return Transform2()
    if (found := mount_transform(frames, WORLD, frame)) is None:
        return None
    return Transform2(x=found.translation[0], y=found.translation[1], yaw=found.rpy[2])


def mount_transform(frames: TransformBuffer, base: str, frame: str) -> SE3 | None:
    """Where a frame lies in ``base``; None when ``/tf_static`` does not tell."""
    if base == frame:
        return IDENTITY
    try:
        found = frames.lookup(base, frame)
    except NoTransform:
        return None
    return found.transform if found.time is None else None
