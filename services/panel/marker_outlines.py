"""Markers as the map draws them: areas, lines and texts, seen from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3
from messages.visualization import Marker
from services.driving.footprint import (
    box_footprint,
    cylinder_footprint,
    points_footprint,
    sphere_footprint,
    transformed,
    triangle_footprints,
)
from services.driving.world_bodies import MAX_TRIANGLES, marker_triangles
from services.runtime.errors import BadInput

Floats = NDArray[np.float64]
Outline = list[float]
"""Corners as x, y, x, y, …, m."""

MAX_POINTS = 20_000
"""Points of a marker that are drawn."""
HEAD = 0.3
"""Share of an arrow's length that its head takes."""


def marker_outline(marker: Marker, frame: Pose3) -> dict[str, Any]:
    """A marker for the page, whose frame has the pose ``frame`` in the world; raises BadInput if it cannot be drawn.

    Returns:
        Its ``kind`` (``area``, ``line`` or ``text``), ``colour`` and ``outlines``, the ``width`` [m] of a line, and the
        ``text`` with its height as ``width``.
    """
    pose, size = frame @ Pose3.from_msg(marker.pose), marker.scale
    shape: dict[str, Any] = {"kind": "area", "colour": _colour(marker)}
    match marker.type:
        case Marker.LINE_STRIP:
            return {**shape, "kind": "line", "width": size.x, "outlines": [_flat(_points(marker, pose))]}
        case Marker.LINE_LIST:
            ends = _points(marker, pose)
            pairs = ends[: len(ends) // 2 * 2].reshape(-1, 2, 3)
            return {**shape, "kind": "line", "width": size.x, "outlines": [_flat(each) for each in pairs]}
        case Marker.TEXT_VIEW_FACING:
            at = _flat(np.array([pose.position]))
            return {**shape, "kind": "text", "text": marker.text[:200], "width": size.z, "outlines": [at]}
    return {**shape, "outlines": _areas(marker, pose)}


def _areas(marker: Marker, pose: Pose3) -> list[Outline]:
    size = marker.scale.x, marker.scale.y, marker.scale.z
    match marker.type:
        case Marker.ARROW:
            return [_arrow(marker, pose)]
        case Marker.CUBE:
            return [_flat(box_footprint(pose, size).polygon())]
        case Marker.SPHERE:
            return [_flat(sphere_footprint(pose, max(size[0], size[1])).polygon())]
        case Marker.CYLINDER:
            return [_flat(cylinder_footprint(pose, max(size[0], size[1]), size[2]).polygon())]
        case Marker.CUBE_LIST | Marker.POINTS:
            square = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size[:2]
            return [_flat(at[:2] + square) for at in _points(marker, pose)]
        case Marker.SPHERE_LIST:
            return [
                _flat(sphere_footprint(Pose3(tuple(at)), size[0]).polygon()) for at in _points(marker, pose).tolist()
            ]
        case Marker.TRIANGLE_LIST if marker.points:
            return [_flat(each.corners) for each in triangle_footprints(pose, marker_triangles(marker))[:MAX_TRIANGLES]]
        case Marker.MESH_RESOURCE:
            return [_flat(points_footprint(pose, marker_triangles(marker).reshape(-1, 3)).polygon())]
    raise BadInput(f"a marker {marker.ns!r} of the type {marker.type} with {len(marker.points)} points is not drawn")


def _arrow(marker: Marker, pose: Pose3) -> Outline:
    """An arrow's outline: between its two points, or along x of its pose."""
    if len(marker.points) >= 2:
        start, end = _points(marker, pose)[:2, :2]
        width = marker.scale.x
    else:
        start, end = transformed(pose, np.array([(0.0, 0.0, 0.0), (marker.scale.x, 0.0, 0.0)]))[:, :2]
        width = marker.scale.y
    along = end - start
    length = float(np.hypot(*along))
    across = np.array((-along[1], along[0])) / length * width if length else np.zeros(2)
    neck = start + (1 - HEAD) * along
    corners = [start + across / 2, neck + across / 2, neck + across, end]
    corners += [neck - across, neck - across / 2, start - across / 2]
    return _flat(np.array(corners))


def _points(marker: Marker, pose: Pose3) -> Floats:
    rows = np.array([(each.x, each.y, each.z) for each in marker.points[:MAX_POINTS]], np.float64).reshape(-1, 3)
    return transformed(pose, rows) if len(rows) else rows


def _flat(corners: Floats) -> Outline:
    """To the millimetre."""
    outline: Outline = np.round(corners[:, :2], 3).ravel().tolist()
    return outline


def _colour(marker: Marker) -> str:
    c = marker.color if not marker.colors else marker.colors[0]
    return "#{:02x}{:02x}{:02x}{:02x}".format(*(round(255 * each) for each in (c.r, c.g, c.b, c.a)))
