"""Tracks the detected obstacles from scan to scan: their positions in the odom frame, and velocities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.se2 import Pose2
from services.local_planner.detection import NOTHING, Detections
from services.markers.footprint import transform_points

Floats = NDArray[np.float64]

SAME = 0.15
"""Maximum distance [m] of a disc from its predicted position to be matched with the previous scan."""
SMOOTHING = 0.5
"""Weight of a new velocity measurement in the estimate."""
LONGEST_GAP_S = 1.0
"""Time between two scans [s] beyond which nothing is tracked from one to the next."""


class Obstacles(NamedTuple):
    """Circles around detected objects, in the odom frame.

    Args:
        positions: Their centres at the time of the estimate, (n, 2) [m].
        velocities: (n, 2) [m/s]; 0 for obstacles.
        robots: Whether each may be a robot, which moves and gives way itself, (n,).
    """

    positions: Floats
    velocities: Floats
    robots: NDArray[np.bool_]


NO_OBSTACLES = Obstacles(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, np.bool_))


class Tracker:
    """The discs and points of the last scan, with the velocities of discs that were also in the previous one."""

    def __init__(self) -> None:
        self.stamp: int | None = None
        self._discs, self._velocities = NOTHING.discs, NOTHING.discs
        self._points = NOTHING.points

    def update(self, stamp: int, laser: Pose2, seen: Detections) -> None:
        """Add a scan from the time ``stamp`` [ns], taken by a laser at ``laser`` in the odom frame."""
        discs = transform_points(laser, seen.discs)
        velocities = np.zeros_like(discs)
        dt = (stamp - self.stamp) / 1e9 if self.stamp is not None else 0.0
        if 0 < dt <= LONGEST_GAP_S and len(discs) and len(self._discs):
            expected = self._discs + self._velocities * dt
            apart = np.hypot(
                discs[:, 0, None] - expected[None, :, 0],
                discs[:, 1, None] - expected[None, :, 1],
            )
            match = apart.argmin(1)
            same = apart[np.arange(len(discs)), match] < SAME
            before = match[same]
            measured = (discs[same] - self._discs[before]) / dt
            velocities[same] = self._velocities[before] + SMOOTHING * (measured - self._velocities[before])
        self.stamp, self._discs, self._velocities = stamp, discs, velocities
        self._points = transform_points(laser, seen.points)

    def obstacles(self, now: int) -> Obstacles:
        """Return the obstacles at ``now`` [ns]; discs are assumed to keep their velocity since the last scan."""
        if self.stamp is None or not len(self._discs) + len(self._points):
            return NO_OBSTACLES
        discs = self._discs + self._velocities * ((now - self.stamp) / 1e9)
        if not len(self._points):
            return Obstacles(discs, self._velocities, np.ones(len(discs), np.bool_))
        return Obstacles(
            np.concatenate((discs, self._points)),
            np.concatenate((self._velocities, np.zeros_like(self._points))),
            np.arange(len(discs) + len(self._points)) < len(discs),
        )
