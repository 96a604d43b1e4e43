"""Converts markers to shapes of the viewer."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from messages.errors import BadInput
from messages.se3 import IDENTITY, Pose3
from messages.std import ColorRGBA
from messages.visualization import Marker
from services.markers.footprint import transformed
from services.markers.world_bodies import marker_triangles

FLAT_TRIANGLES = 50_000
"""Maximum number of triangles of a mesh with flat shading, which takes three vertices per triangle."""

Floats = NDArray[np.float64]
Rgba = tuple[int, ...]


def marker_shape(marker: Marker, pose: Pose3 = IDENTITY) -> rr.AsComponents:
    """Return a marker's shape with its own frame at ``pose``; raises BadInput for one that cannot be displayed."""
    half = marker.scale.x / 2, marker.scale.y / 2, marker.scale.z / 2
    colour, place = _rgba(marker.color), ([pose.position], [rr.Quaternion(xyzw=pose.orientation)])
    match marker.type:
        case Marker.CUBE:
            centres, turns = place
            return rr.Boxes3D(half_sizes=[half], centers=centres, quaternions=turns, colors=[colour], fill_mode="solid")
        case Marker.SPHERE:
            centres, turns = place
            return rr.Ellipsoids3D(
                half_sizes=[half], centers=centres, quaternions=turns, colors=[colour], fill_mode="solid"
            )
        case Marker.CYLINDER if half[0] == half[1]:
            centres, turns = place
            return rr.Cylinders3D(
                lengths=[2 * half[2]],
                radii=[half[0]],
                centers=centres,
                quaternions=turns,
                colors=[colour],
                fill_mode="solid",
            )
        case Marker.TEXT_VIEW_FACING:
            return rr.Points3D([pose.position], radii=[0.0], colors=[colour], labels=[marker.text], show_labels=True)
        case Marker.ARROW:
            return _arrow(marker, pose, colour)
        case Marker.LINE_STRIP | Marker.LINE_LIST:
            return _lines(marker, pose, colour)
        case Marker.CUBE_LIST:
            points = _points(marker, pose)
            return rr.Boxes3D(
                half_sizes=[half] * len(points), centers=points, colors=_colours(marker, colour), fill_mode="solid"
            )
        case Marker.SPHERE_LIST | Marker.POINTS:
            return rr.Points3D(_points(marker, pose), radii=[half[0]], colors=_colours(marker, colour))
    return _mesh(marker, pose, colour)


def _arrow(marker: Marker, pose: Pose3, colour: Rgba) -> rr.Arrows3D:
    """Return an arrow between its two points, with a shaft of width ``scale.x``, or along x of its pose."""
    if len(marker.points) >= 2:
        (start, end), width = _points(marker, pose)[:2], marker.scale.x
    else:
        start, end = transformed(pose, np.array([(0.0, 0.0, 0.0), (marker.scale.x, 0.0, 0.0)]))
        width = marker.scale.y
    return rr.Arrows3D(vectors=[end - start], origins=[start], radii=[width / 2], colors=[colour])


def _lines(marker: Marker, pose: Pose3, colour: Rgba) -> rr.LineStrips3D:
    points = _points(marker, pose)
    if marker.type == Marker.LINE_STRIP:
        return rr.LineStrips3D([points], radii=[marker.scale.x / 2], colors=[colour])
    pairs = points[: len(points) // 2 * 2].reshape(-1, 2, 3)
    return rr.LineStrips3D(list(pairs), radii=[marker.scale.x / 2], colors=[colour])


def _mesh(marker: Marker, pose: Pose3, colour: Rgba) -> rr.Mesh3D:
    triangles = marker_triangles(marker)
    if pose != IDENTITY:
        triangles = transformed(pose, triangles.reshape(-1, 3)).reshape(-1, 3, 3)
    if len(triangles) > FLAT_TRIANGLES:
        corners, triangle = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
        return rr.Mesh3D(vertex_positions=corners, triangle_indices=triangle.reshape(-1, 3), albedo_factor=colour)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    every = _colours(marker, colour) if len(marker.colors) == len(marker.points) > 0 else None
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3),
        vertex_normals=np.repeat(normals, 3, axis=0),
        vertex_colors=every,
        albedo_factor=None if every else colour,
    )


def _points(marker: Marker, pose: Pose3) -> Floats:
    points = np.array([(each.x, each.y, each.z) for each in marker.points], np.float64).reshape(-1, 3)
    if not len(points):
        raise BadInput(f"the marker {marker.ns!r} {marker.id} of the type {marker.type} has no points")
    return transformed(pose, points)


def _colours(marker: Marker, colour: Rgba) -> list[Rgba]:
    """Return one colour per point, or one for all."""
    if len(marker.colors) != len(marker.points):
        return [colour]
    return [_rgba(each) for each in marker.colors]


def _rgba(c: ColorRGBA) -> Rgba:
    return tuple(round(255 * each) for each in (c.r, c.g, c.b, c.a))
