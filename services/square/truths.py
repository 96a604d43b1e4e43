"""Ground truth of the last moments, to find that of odometry's stamp."""

from __future__ import annotations

from services.motion.planar import Planar

KEPT = 64
"""Samples; more than a second of them."""


class Truths:
    """True poses by their stamps, the newest KEPT."""

    def __init__(self) -> None:
        self._poses: dict[int, Planar] = {}

    def add(self, stamp: int, pose: Planar) -> None:
        """Keep the pose of a stamp [ns]."""
        self._poses[stamp] = pose
        if len(self._poses) > KEPT:
            del self._poses[next(iter(self._poses))]

    def at(self, stamp: int) -> Planar | None:
        """The pose of exactly this stamp [ns], if it is still known."""
        return self._poses.get(stamp)
