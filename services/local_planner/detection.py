"""Detects objects in a laser scan: discs that may be other robots, and points of obstacles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.sensor import LaserScan
from services.local_planner import LocalPlannerParameters

Floats = NDArray[np.float64]

EDGE = 0.1
"""Difference [m] between the ranges of adjacent rays that separates two objects."""
FACING = math.pi / 4
"""Mean distance of a disc's visible side from its centre, in radii: the mean of sqrt(1 - u^2) over its width."""
WIDTH_MARGIN = 1.5
"""Maximum width of a robot's disc, in diameters: noise and the width of a ray increase it."""
POINT_RAYS = 4
"""Number of an obstacle's rays that are reduced to one point, the nearest."""


class Detections(NamedTuple):
    """Centres of discs and points of obstacles, (n, 2) and (m, 2) [m], in the laser's frame."""

    discs: Floats
    points: Floats


NOTHING = Detections(np.empty((0, 2)), np.empty((0, 2)))


def detect(scan: LaserScan, p: LocalPlannerParameters) -> Detections:
    """Group the rays of a scan into objects, and classify them by width as robots or obstacles."""
    ranges = scan.ranges.numpy()
    seen = np.flatnonzero((ranges >= scan.range_min) & (ranges <= min(scan.range_max, p.view)))
    if not len(seen):
        return NOTHING
    near = ranges[seen].astype(np.float64)
    starts, near, rays = _objects(seen, near, len(ranges), abs(scan.angle_increment))
    sizes = np.diff(np.append(starts, len(near)))
    middle = np.add.reduceat(near, starts) / sizes
    widths = middle * sizes * abs(scan.angle_increment)
    angles = scan.angle_min + scan.angle_increment * rays
    narrow = widths <= 2 * p.seen_radius * WIDTH_MARGIN
    towards = np.add.reduceat(angles, starts) / sizes
    centres = middle + FACING * p.seen_radius
    discs = np.column_stack((centres * np.cos(towards), centres * np.sin(towards)))[narrow]
    if narrow.all():
        return Detections(discs, NOTHING.points)
    nearest = [
        block + int(near[block : min(block + POINT_RAYS, start + size)].argmin())
        for start, size in zip(starts[~narrow].tolist(), sizes[~narrow].tolist(), strict=True)
        for block in range(start, start + size, POINT_RAYS)
    ]
    return Detections(
        discs, np.column_stack((near[nearest] * np.cos(angles[nearest]), near[nearest] * np.sin(angles[nearest])))
    )


def _objects(
    seen: NDArray[np.intp], near: Floats, count: int, increment: float
) -> tuple[NDArray[np.intp], Floats, NDArray[np.intp]]:
    """Return the start of each object, with ranges and rays ordered such that no object wraps around.

    Ray numbers of a wrapped object continue beyond a full turn, so that the mean of their angles is the object's.
    """
    gaps = (np.diff(seen) > 1) | (np.abs(np.diff(near)) > EDGE)
    whole_turn = abs(count * increment - math.tau) < 1.5 * increment
    joined = whole_turn and seen[0] == 0 and seen[-1] == count - 1 and abs(near[0] - near[-1]) <= EDGE
    if joined and gaps.any():
        first = int(np.argmax(gaps)) + 1
        seen = np.concatenate((seen[first:], seen[:first] + count))
        near = np.roll(near, -first)
        gaps = (np.diff(seen) > 1) | (np.abs(np.diff(near)) > EDGE)
    return np.concatenate(([0], np.flatnonzero(gaps) + 1)), near, seen
