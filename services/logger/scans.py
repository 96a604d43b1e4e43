"""Converts laser scans to points in the world, by the robot's true pose at their stamps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3
from messages.sensor import LaserScan
from services.logger.static_frames import mount_transform
from services.markers.displays import scan_points
from services.markers.footprint import transformed
from services.runtime.tf.buffer import TransformBuffer

MAX_SCANS = 200
"""Maximum number of scans kept between two batches: 40 s of a laser at 5 Hz."""

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class ScanBuffer:
    """Keeps a robot's scans until the true pose at their stamps is known; beyond ``limit`` the oldest are dropped.

    In the laser's own frame, points would move with the robot until its next scan, and smear as it turns.
    """

    def __init__(self, frames: TransformBuffer, limit: int = MAX_SCANS) -> None:
        self.dropped = 0
        self._frames, self._limit = frames, limit
        self._waiting: list[LaserScan] = []

    def add(self, scans: Sequence[LaserScan]) -> None:
        """Add scans, newest last."""
        self._waiting += scans
        if (excess := len(self._waiting) - self._limit) > 0:
            del self._waiting[:excess]
            self.dropped += excess

    def clear(self) -> None:
        """Drop the waiting scans."""
        self._waiting = []

    def to_world(self, base: str, truth: Floats) -> tuple[Stamps, list[Floats]]:
        """Return times [ns] and echoes, each (n, 3) [m] in the world, of the scans whose pose is now known.

        ``truth`` has rows of time [ns], position [m] and quaternion (x, y, z, w) of the frame ``base``. Scans from
        before it, and those of a laser without a transform, are left out.
        """
        if not len(truth):
            return np.empty(0, np.int64), []
        due = [each for each in self._waiting if each.header.stamp.ns <= truth[-1, 0]]
        self._waiting = self._waiting[len(due) :]
        times, points = [], []
        for scan in due:
            mount = mount_transform(self._frames, base, scan.header.frame_id)
            if mount is not None and scan.header.stamp.ns >= truth[0, 0]:
                times.append(scan.header.stamp.ns)
                points.append(transformed(_pose(truth, scan.header.stamp.ns).compose(mount), scan_points(scan)))
        return np.array(times, np.int64), points


def _pose(truth: Floats, time: int) -> Pose3:
    """Return the pose at a time within ``truth``."""
    after = int(np.searchsorted(truth[:, 0], time))
    late = truth[after]
    early = late if late[0] == time else truth[after - 1]
    span = late[0] - early[0]
    return _pose_from_row(early).interpolate(_pose_from_row(late), float((time - early[0]) / span) if span else 0.0)


def _pose_from_row(row: Floats) -> Pose3:
    x, y, z, i, j, k, w = (float(each) for each in row[1:8])
    return Pose3((x, y, z), (i, j, k, w))
