"""The trail of a robot as short segments: each costs the same, however long the trail has become."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

SPACING = 0.02
"""Metres between the corners of a trail: finer than it is drawn, and a tenth of the rows of a slow robot."""


class Trail:
    """Thins out a path as it comes; the last corner joins one batch to the next."""

    def __init__(self, spacing: float = SPACING) -> None:
        self.spacing = spacing
        self._corner: Floats | None = None

    def extend(self, times: Stamps, positions: Floats) -> tuple[Stamps, Floats]:
        """Segments (m, 2, 3) [m] that positions (n, 3) at ``times`` (n,) [ns] add, and the time (m,) that each ends."""
        if not len(positions):
            return times, np.empty((0, 2, 3))
        corner = positions[0] if self._corner is None else self._corner
        steps = np.diff(np.vstack((corner, positions)), axis=0)
        covered = np.floor(np.cumsum(np.linalg.norm(steps, axis=1)) / self.spacing)
        new = np.flatnonzero(np.diff(covered, prepend=0.0) > 0)
        corners = np.vstack((corner, positions[new]))
        self._corner = corners[-1]
        return times[new], np.stack((corners[:-1], corners[1:]), axis=1)
