"""What bodies cover on the ground as seen from above, and how far points of the ground are from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, Vector, rotate, rotated_axes

Floats = NDArray[np.float64]

CIRCLE_POINTS = 48
"""Corners of a circle where a polygon stands for it: its edge lies within 0.2 % of the radius."""

LARGEST_BLOCK = 1 << 19
"""Pairs of point and edge whose distances are computed at once: 4 MiB for each array on the way."""

UPRIGHT = 1 - 1e-9
"""Cosine of the angle to the vertical up to which a cylinder covers a circle."""

FLAT = 1e-12
"""Area [m2] below which an outline encloses nothing: a plate on its edge."""


class Footprint(NamedTuple):
    """A convex area of the ground: all within ``radius`` [m] of the polygon ``corners``.

    ``corners``, shape (n, 2) [m], are counter-clockwise in the world; a circle is one corner and a radius. The body
    that covers it reaches from the height ``bottom`` to ``top`` [m].
    """

    corners: Floats
    radius: float
    bottom: float
    top: float

    def polygon(self) -> Floats:
        """Its outline as a polygon, shape (n, 2) [m]; a circle has CIRCLE_POINTS corners."""
        if self.radius == 0:
            return self.corners
        turn = np.linspace(0, 2 * math.pi, CIRCLE_POINTS, endpoint=False)
        circle = self.radius * np.column_stack((np.cos(turn), np.sin(turn)))
        if len(self.corners) == 1:
            return self.corners + circle
        return convex_hull((self.corners[:, None] + circle).reshape(-1, 2))


def box_footprint(pose: Pose3, size: Vector) -> Footprint:
    """What a box covers, of the full ``size`` [m], turned in any way."""
    half = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    return points_footprint(pose, half)


def sphere_footprint(pose: Pose3, diameter: float) -> Footprint:
    """What a sphere covers, ``diameter`` in m."""
    x, y, z = pose.position
    return Footprint(np.array([[x, y]]), diameter / 2, z - diameter / 2, z + diameter / 2)


def cylinder_footprint(pose: Pose3, diameter: float, length: float) -> Footprint:
    """What a cylinder covers, its axis along z of its frame; m. Of a tilted one the ends are polygons."""
    x, y, z = pose.position
    axis = rotated_axes(pose.orientation)[2]
    if abs(axis[2]) > UPRIGHT:
        return Footprint(np.array([[x, y]]), diameter / 2, z - length / 2, z + length / 2)
    turn = np.linspace(0, 2 * math.pi, CIRCLE_POINTS, endpoint=False)
    rim = diameter / 2 * np.column_stack((np.cos(turn), np.sin(turn), np.zeros(CIRCLE_POINTS)))
    ends = np.array([(0, 0, -length / 2)]), np.array([(0, 0, length / 2)])
    return points_footprint(pose, np.concatenate([rim + end for end in ends]))


def points_footprint(pose: Pose3, points: Floats) -> Footprint:
    """What the convex hull of points covers, shape (n, 3) [m] in the frame that has the pose ``pose``."""
    x, y, z = transformed(pose, points).T
    return Footprint(convex_hull(np.column_stack((x, y))), 0.0, float(z.min()), float(z.max()))


def transformed(pose: Pose3, points: Floats) -> Floats:
    """Points of a frame, shape (n, 3) [m], in its parent, in which the frame has the pose ``pose``."""
    x, y, z = points.T
    moved: Floats = np.column_stack(rotate(pose.orientation, (x, y, z))) + np.array(pose.position)
    return moved


def convex_hull(points: Floats) -> Floats:
    """The corners of the convex hull of points, shape (n, 2), counter-clockwise (Andrew's monotone chain)."""
    points = np.unique(_near_the_edge(points), axis=0)
    if len(points) < 3:
        return points
    rows = [(float(x), float(y)) for x, y in points]
    lower, upper = _half_hull(rows), _half_hull(rows[::-1])
    return np.array(lower[:-1] + upper[:-1])


def _half_hull(rows: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    hull: list[tuple[float, float]] = []
    for x, y in rows:
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            hull.pop()
        hull.append((x, y))
    return hull


def _near_the_edge(points: Floats) -> Floats:
    """Points without most of those that lie inside: the chain takes a second for a million of them."""
    if len(points) < 256:
        return points
    turn = np.linspace(0, 2 * math.pi, 32, endpoint=False)
    extremes = points[np.unique([np.argmax(points @ (math.cos(each), math.sin(each))) for each in turn])]
    inner = convex_hull(extremes)
    if len(inner) < 3:
        return points
    edges = np.roll(inner, -1, axis=0) - inner
    inside = np.ones(len(points), bool)
    for corner, edge in zip(inner, edges, strict=True):
        inside &= edge[0] * (points[:, 1] - corner[1]) - edge[1] * (points[:, 0] - corner[0]) > 0
    kept: Floats = np.concatenate((points[~inside], inner))
    return kept


class BodyDistances:
    """The planar distances of points to bodies, each of one or several footprints.

    Exact for polygons and circles. 100 points and 200 boxes take 2 ms.
    """

    def __init__(self, bodies: Sequence[Sequence[Footprint]]) -> None:
        parts = [part for body in bodies for part in body]
        self._count = len(bodies)
        self._body_starts = _starts([len(body) for body in bodies])
        self._part_starts = _starts([len(part.corners) for part in parts])
        self._radius = np.array([part.radius for part in parts])
        self._encloses = np.array([_area(part.corners) > FLAT for part in parts], bool)
        corners = [part.corners for part in parts]
        self._from = np.concatenate(corners) if parts else np.empty((0, 2))
        self._along = (
            np.concatenate([np.roll(each, -1, axis=0) for each in corners]) if parts else self._from
        ) - self._from
        square = (self._along**2).sum(axis=1)
        self._per_square = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0)

    def to(self, points: Floats) -> Floats:
        """The distances of ``points``, shape (n, 2) [m], to each body, shape (n, bodies) [m]; below 0 inside one."""
        if not self._count:
            return np.empty((len(points), 0))
        block = max(1, LARGEST_BLOCK // max(1, len(self._from)))
        return np.concatenate([self._block(points[at : at + block]) for at in range(0, max(1, len(points)), block)])

    def _block(self, points: Floats) -> Floats:
        dx = points[:, :1] - self._from[:, 0]
        dy = points[:, 1:] - self._from[:, 1]
        ex, ey = self._along[:, 0], self._along[:, 1]
        share = np.clip((dx * ex + dy * ey) * self._per_square, 0, 1)
        beside = ex * dy - ey * dx
        distance = np.sqrt(
            np.minimum.reduceat((dx - share * ex) ** 2 + (dy - share * ey) ** 2, self._part_starts, axis=1)
        )
        inside = (np.minimum.reduceat(beside, self._part_starts, axis=1) >= 0) & self._encloses
        distance = np.where(inside, -distance, distance) - self._radius
        nearest: Floats = np.minimum.reduceat(distance, self._body_starts, axis=1)
        return nearest


def _starts(counts: Sequence[int]) -> NDArray[np.intp]:
    if not all(counts):
        raise ValueError("a body without a footprint has no distance")
    return (
        np.concatenate(([0], np.cumsum(counts, dtype=np.intp)[:-1])).astype(np.intp) if counts else np.empty(0, np.intp)
    )


def _area(corners: Floats) -> float:
    x, y = corners.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
