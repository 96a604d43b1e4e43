"""A planar polygon, extruded to a triangulated prism."""

from __future__ import annotations

import numpy as np

from messages.errors import BadInput
from models.mesh import Mesh

MAX_CORNERS = 1000

Point2 = tuple[float, float]


def extruded(corners: list[Point2], height: float) -> Mesh:
    """Return the prism over a simple polygon, from z = 0 to ``height`` [m]; raises BadInput.

    The polygon may be concave and of either orientation, and its last corner may repeat the first. It is triangulated
    by ear clipping (Meisters 1975).
    """
    points = [point for point, before in zip(corners, [None, *corners], strict=False) if point != before]
    if len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if not 3 <= len(points) <= MAX_CORNERS:
        raise BadInput(f"a polyline has 3 to {MAX_CORNERS} corners, not {len(points)}")
    if _area(points) < 0:
        points.reverse()
    count, faces = len(points), _ears(points)
    lower = [(x, y, 0.0) for x, y in points]
    upper = [(x, y, height) for x, y in points]
    triangles = [(c, b, a) for a, b, c in faces] + [(a + count, b + count, c + count) for a, b, c in faces]
    for here in range(count):
        there = (here + 1) % count
        triangles += [(here, there, there + count), (here, there + count, here + count)]
    return Mesh(np.array(lower + upper), np.array(triangles, np.int32))


def _ears(points: list[Point2]) -> list[tuple[int, int, int]]:
    left, faces = list(range(len(points))), []
    while len(left) > 3:
        for place in range(len(left)):
            a, b, c = left[place - 1], left[place], left[(place + 1) % len(left)]
            if _turn(points[a], points[b], points[c]) <= 0:
                continue
            if any(_inside(points[each], points[a], points[b], points[c]) for each in left if each not in (a, b, c)):
                continue
            faces.append((a, b, c))
            del left[place]
            break
        else:
            raise BadInput("the polyline crosses itself")
    faces.append((left[0], left[1], left[2]))
    return faces


def _area(points: list[Point2]) -> float:
    return sum(_turn((0.0, 0.0), one, other) for one, other in zip(points, [*points[1:], points[0]], strict=True)) / 2


def _turn(a: Point2, b: Point2, c: Point2) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _inside(point: Point2, a: Point2, b: Point2, c: Point2) -> bool:
    return min(_turn(a, b, point), _turn(b, c, point), _turn(c, a, point)) >= 0
