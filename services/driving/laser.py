"""What a laser sees, as points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from messages.sensor import LaserScan

Floats = NDArray[np.float64]


def scan_points(scan: LaserScan) -> Floats:
    """The echoes of a scan, (n, 3) [m] in the laser's frame; rays without an echo are left out."""
    ranges = scan.ranges.numpy().astype(np.float64)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    seen = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    near, turn = ranges[seen], angles[seen]
    return np.column_stack((near * np.cos(turn), near * np.sin(turn), np.zeros(len(near))))
