"""Triangulates shapes: for display, and for shapes that the physics supports only as triangles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, rotated_axes
from models.bodies import BoxShape, CylinderShape, HeightMapShape, MeshShape, RampShape, Shape, SphereShape
from models.mesh import Mesh

SIDES = 24
"""Number of sides of a cylinder, and of meridians of a sphere."""


def shape_mesh(shape: Shape, most_rows: int = 0) -> Mesh:
    """Return the triangles of a shape in its own frame, counter-clockwise as seen from outside.

    Args:
        shape: The shape.
        most_rows: Maximum number of rows and columns of a height map, 0 for all.
    """
    match shape:
        case BoxShape():
            return _hexahedron(shape.size)
        case RampShape():
            return ramp_mesh(shape)
        case CylinderShape():
            return _stacked([(shape.radius, -shape.length / 2), (shape.radius, shape.length / 2)], shape.length / 2)
        case SphereShape(radius):
            turns = [math.pi * (ring / (SIDES // 2) - 0.5) for ring in range(1, SIDES // 2)]
            return _stacked([(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns], radius)
        case MeshShape():
            return shape.mesh
        case HeightMapShape():
            return height_map_mesh(shape, most_rows)


def placed(mesh: Mesh, pose: Pose3) -> Mesh:
    """Transform a mesh from a frame with ``pose`` to its parent."""
    axes = np.array(rotated_axes(pose.orientation))
    return Mesh(mesh.vertices @ axes + np.array(pose.position), mesh.triangles)


def joined(meshes: list[Mesh]) -> Mesh:
    """Merge several meshes into one."""
    starts = np.cumsum([0, *(len(each.vertices) for each in meshes[:-1])])
    triangles = [each.triangles + start for each, start in zip(meshes, starts, strict=True)]
    return Mesh(np.concatenate([each.vertices for each in meshes]), np.concatenate(triangles).astype(np.int32))


def ramp_mesh(shape: RampShape) -> Mesh:
    """Return the mesh of a wedge: its bottom, its vertical back at +x, its slope and its two sides."""
    x, y, z = (extent / 2 for extent in shape.size)
    vertices = np.array([(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z), (x, -y, z), (x, y, z)])
    triangles = [(0, 2, 1), (0, 3, 2), (1, 2, 5), (1, 5, 4), (0, 4, 5), (0, 5, 3), (0, 1, 4), (3, 5, 2)]
    return Mesh(vertices, np.array(triangles, np.int32))


def height_map_mesh(shape: HeightMapShape, most_rows: int = 0) -> Mesh:
    """Return the surface of a height map; with ``most_rows``, of at most as many evenly chosen rows and columns."""
    rows, columns = shape.heights.shape
    picked_rows, picked_columns = _picked(rows, most_rows), _picked(columns, most_rows)
    x = (picked_columns / (columns - 1) - 0.5) * shape.size[0]
    y = (picked_rows / (rows - 1) - 0.5) * shape.size[1]
    across, along = np.meshgrid(x, y)
    heights = shape.heights[np.ix_(picked_rows, picked_columns)]
    index = np.arange(heights.size, dtype=np.int32).reshape(heights.shape)
    a, b, c, d = (each.ravel() for each in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate([np.column_stack((a, b, c)), np.column_stack((a, c, d))])
    return Mesh(np.column_stack((across.ravel(), along.ravel(), heights.ravel())), triangles)


def _picked(count: int, most: int) -> NDArray[np.intp]:
    if not most or count <= most:
        return np.arange(count)
    picked: NDArray[np.intp] = np.unique(np.linspace(0, count - 1, most).round().astype(np.intp))
    return picked


def _hexahedron(size: tuple[float, float, float]) -> Mesh:
    x, y, z = (extent / 2 for extent in size)
    vertices = [(i * x, j * y, k * z) for k in (-1, 1) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    triangles = [each for a, b, c, d in faces for each in ((a, b, c), (a, c, d))]
    return Mesh(np.array(vertices), np.array(triangles, np.int32))


def _stacked(rings: list[tuple[float, float]], end: float) -> Mesh:
    """Return a solid of rings (radius, height [m]) about z, from bottom to top, with end points at -end and +end."""
    turns = np.arange(SIDES) * 2 * math.pi / SIDES
    circle = np.column_stack((np.cos(turns), np.sin(turns)))
    layers = [np.column_stack((radius * circle, np.full(SIDES, height))) for radius, height in rings]
    vertices = np.concatenate([*layers, [(0.0, 0.0, -end), (0.0, 0.0, end)]])
    low, high = len(vertices) - 2, len(vertices) - 1
    near = np.arange(SIDES)
    far = (near + 1) % SIDES
    last = (len(rings) - 1) * SIDES
    triangles = [np.column_stack((far, near, np.full(SIDES, low)))]
    for start in range(0, last, SIDES):
        triangles.append(np.column_stack((near, far, far + SIDES)) + start)
        triangles.append(np.column_stack((near, far + SIDES, near + SIDES)) + start)
    triangles.append(np.column_stack((near + last, far + last, np.full(SIDES, high))))
    return Mesh(vertices, np.concatenate(triangles).astype(np.int32))
