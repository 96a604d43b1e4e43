"""Footprints of bodies on the ground, and distances of points from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.se2 import Pose2
from messages.se3 import Pose3, Vector, rotate, rotated_axes

Floats = NDArray[np.float64]

CIRCLE_POINTS = 48
"""Corners of the polygon that approximates a circle: its edges are within 0.2 % of the radius."""

LARGEST_BLOCK = 1 << 19
"""Maximum number of point-edge pairs whose distances are computed at once: 4 MiB per intermediate array."""

UPRIGHT = 1 - 1e-9
"""Cosine of the tilt up to which a cylinder's footprint is a circle."""

FLAT = 1e-12
"""Area [m2] below which an outline is degenerate, e.g. that of a plate on its edge."""


class Footprint(NamedTuple):
    """A convex area of the ground: all points within ``radius`` [m] of the polygon ``corners``.

    ``corners``, shape (n, 2) [m], are counter-clockwise in the world frame; a circle is one corner and a radius. The
    body spans the heights from ``bottom`` to ``top`` [m].
    """

    corners: Floats
    radius: float
    bottom: float
    top: float

    def polygon(self) -> Floats:
        """Return the outline as a polygon, shape (n, 2) [m]; a circle has CIRCLE_POINTS corners."""
        if self.radius == 0:
            return self.corners
        turn = np.linspace(0, 2 * math.pi, CIRCLE_POINTS, endpoint=False)
        circle = self.radius * np.column_stack((np.cos(turn), np.sin(turn)))
        if len(self.corners) == 1:
            return self.corners + circle
        return convex_hull((self.corners[:, None] + circle).reshape(-1, 2))


def box_footprint(pose: Pose3, size: Vector) -> Footprint:
    """Return the footprint of a box of full ``size`` [m] in any orientation."""
    half = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    return points_footprint(pose, half)


def sphere_footprint(pose: Pose3, diameter: float) -> Footprint:
    """Return the footprint of a sphere with ``diameter`` [m]."""
    x, y, z = pose.position
    return Footprint(np.array([[x, y]]), diameter / 2, z - diameter / 2, z + diameter / 2)


def cylinder_footprint(pose: Pose3, diameter: float, length: float) -> Footprint:
    """Return the footprint of a cylinder along z of its frame [m]; if tilted, its ends are polygons."""
    x, y, z = pose.position
    axis = rotated_axes(pose.orientation)[2]
    if abs(axis[2]) > UPRIGHT:
        return Footprint(np.array([[x, y]]), diameter / 2, z - length / 2, z + length / 2)
    turn = np.linspace(0, 2 * math.pi, CIRCLE_POINTS, endpoint=False)
    rim = diameter / 2 * np.column_stack((np.cos(turn), np.sin(turn), np.zeros(CIRCLE_POINTS)))
    ends = np.array([(0, 0, -length / 2)]), np.array([(0, 0, length / 2)])
    return points_footprint(pose, np.concatenate([rim + end for end in ends]))


def points_footprint(pose: Pose3, points: Floats) -> Footprint:
    """Return the footprint of the convex hull of points, shape (n, 3) [m] in the frame with the pose ``pose``."""
    x, y, z = transformed(pose, points).T
    return Footprint(convex_hull(np.column_stack((x, y))), 0.0, float(z.min()), float(z.max()))


def transform_points(transform: Pose2, points: Floats) -> Floats:
    """Transform points of shape (n, 2) [m] from a frame with the pose ``transform`` to its parent."""
    c, s = math.cos(transform.yaw), math.sin(transform.yaw)
    x, y = points[:, 0], points[:, 1]
    return np.column_stack((c * x - s * y + transform.x, s * x + c * y + transform.y))


def transformed(pose: Pose3, points: Floats) -> Floats:
    """Transform points, shape (n, 3) [m], from the frame with the pose ``pose`` to its parent."""
    x, y, z = points.T
    moved: Floats = np.column_stack(rotate(pose.orientation, (x, y, z))) + np.array(pose.position)
    return moved


def convex_hull(points: Floats) -> Floats:
    """Return the corners of the convex hull of points, shape (n, 2), counter-clockwise (Andrew's monotone chain)."""
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
    """Remove most interior points: the monotone chain takes a second for a million of them."""
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


def triangle_footprints(pose: Pose3, triangles: Floats) -> list[Footprint]:
    """Return the footprint of each triangle; shape (n, 3, 3) [m] in the frame with the pose ``pose``."""
    moved = transformed(pose, triangles.reshape(-1, 3)).reshape(-1, 3, 3)
    (ax, ay), (bx, by) = (moved[:, 1] - moved[:, 0])[:, :2].T, (moved[:, 2] - moved[:, 0])[:, :2].T
    clockwise = ax * by - ay * bx < 0
    moved[clockwise] = moved[clockwise, ::-1]
    bottoms, tops = moved[:, :, 2].min(axis=1).tolist(), moved[:, :, 2].max(axis=1).tolist()
    return [
        Footprint(corners, 0.0, bottom, top)
        for corners, bottom, top in zip(moved[:, :, :2], bottoms, tops, strict=True)
    ]


class NearestBody:
    """Finds the nearest of several bodies, each with one or more footprints, and its distance.

    Distances are planar, and exact for polygons and circles. 100 points among 200 boxes take 3 ms at most.
    """

    def __init__(self, bodies: Sequence[Sequence[Footprint]]) -> None:
        parts = [part for body in bodies for part in body]
        corners = [part.corners for part in parts]
        self._owner = np.repeat(np.arange(len(bodies)), [len(body) for body in bodies])
        self._counts = np.array([len(each) for each in corners], np.intp)
        self._from = np.concatenate([np.empty((0, 2)), *corners])
        ends = [np.roll(each, -1, axis=0) for each in corners]
        self._along = np.concatenate([np.empty((0, 2)), *ends]) - self._from
        square = (self._along**2).sum(axis=1)
        self._per_square = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0)
        self._radius = np.array([part.radius for part in parts])
        self._encloses = np.array([_area(each) > FLAT for each in corners], bool)
        self._bottom, self._top = np.array([part.bottom for part in parts]), np.array([part.top for part in parts])
        self._centre = np.array([each.mean(axis=0) for each in corners]).reshape(-1, 2)
        self._reach = self._radius + [
            float(np.hypot(*(each - centre).T).max()) for each, centre in zip(corners, self._centre, strict=True)
        ]

    def find(
        self, points: Floats, low: Floats, high: Floats, within: Floats | None = None
    ) -> tuple[Floats, NDArray[np.intp]]:
        """Return the distance of each point from the nearest body, and which one it is.

        Args:
            points: Shape (n, 2) [m].
            low: Bodies that end at or below this height [m] are ignored; shape (n,).
            high: Bodies that begin at or above this height [m] are ignored; shape (n,).
            within: Maximum distance [m] to search, shape (n,); unlimited by default.

        Returns:
            Distances [m], negative within a body and infinite if none is found, and the indices of the bodies in the
            list; both of shape (n,).
        """
        distances, nearest = np.full(len(points), math.inf), np.zeros(len(points), np.intp)
        if not len(self._counts):
            return distances, nearest
        limit = np.full(len(points), math.inf) if within is None else within
        block = max(1, LARGEST_BLOCK // len(self._from))
        for at in range(0, len(points), block):
            rows = slice(at, at + block)
            distances[rows], nearest[rows] = self._find(points[rows], low[rows], high[rows], limit[rows])
        return distances, nearest

    def _find(self, points: Floats, low: Floats, high: Floats, within: Floats) -> tuple[Floats, NDArray[np.intp]]:
        away = np.hypot(points[:, :1] - self._centre[:, 0], points[:, 1:] - self._centre[:, 1]) - self._reach
        counts = (away <= within[:, None]) & (self._top > low[:, None]) & (self._bottom < high[:, None])
        chosen = counts.any(axis=0)
        if not chosen.any():
            return np.full(len(points), math.inf), np.zeros(len(points), np.intp)
        every = np.where(counts[:, chosen], self._distances(points, chosen), math.inf)
        nearest = every.argmin(axis=1)
        distance = every[np.arange(len(points)), nearest]
        return np.where(distance <= within, distance, math.inf), self._owner[chosen][nearest]

    def _distances(self, points: Floats, chosen: NDArray[np.bool_]) -> Floats:
        """Return the distances of points from the chosen parts, shape (n, parts) [m]."""
        edges = np.repeat(chosen, self._counts)
        starts = np.concatenate(([0], np.cumsum(self._counts[chosen])[:-1]))
        dx, dy = points[:, :1] - self._from[edges, 0], points[:, 1:] - self._from[edges, 1]
        ex, ey = self._along[edges].T
        share = np.clip((dx * ex + dy * ey) * self._per_square[edges], 0, 1)
        square = (dx - share * ex) ** 2 + (dy - share * ey) ** 2
        distance = np.sqrt(np.minimum.reduceat(square, starts, axis=1))
        inside = np.minimum.reduceat(ex * dy - ey * dx, starts, axis=1) >= 0
        signed: Floats = np.where(inside & self._encloses[chosen], -distance, distance) - self._radius[chosen]
        return signed


def _area(corners: Floats) -> float:
    x, y = corners.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
