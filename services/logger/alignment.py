"""Where the frame of an odometry lies in the world, on the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Alignment:
    """The planar transform p_world = R(yaw) p_odom + (x, y); m and rad."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @classmethod
    def of(cls, truth: tuple[float, float, float], odometry: tuple[float, float, float]) -> Alignment:
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
