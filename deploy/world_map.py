"""Converts a world, seen from above, to the cells of an occupancy map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.errors import BadInput
from models.bodies import BodyPart, MeshShape, WorldDescription
from models.floor_plan import MAX_PIXELS
from models.mesh import Mesh
from models.shape_mesh import placed, shape_mesh
from services.markers.footprint import convex_hull

MARGIN = 0.5
"""Free ground [m] around the outermost body."""
STEP_HEIGHT = 0.05
"""Height [m] below which bodies are not obstacles on the map."""

Floats = NDArray[np.float64]


class WorldMap(NamedTuple):
    """The ``occupied`` cells, shape (rows from the top, columns), and the position of the lower left corner [m]."""

    occupied: NDArray[np.bool_]
    resolution: float
    origin: tuple[float, float]


def world_map(world: WorldDescription, resolution: float, height: float) -> WorldMap:
    """Return the map of a world: a cell is occupied if something solid is between STEP_HEIGHT and ``height``.

    Bodies that move by themselves are left out, and so is the ground that robots drive on: ramps and height maps.

    Args:
        world: The world; movable bodies are where they start.
        resolution: Size of a cell [m].
        height: Upper limit [m]; what is above it, e.g. a lintel or a table top, is left out. A little more than the
            height of the laser.

    Raises:
        BadInput: The map would be too large.
    """
    outlines = list(_outlines(world, STEP_HEIGHT, height))
    corners = np.concatenate([*outlines, np.zeros((1, 2))]) if outlines else np.array([(-5.0, -5.0), (5.0, 5.0)])
    low = np.floor((corners.min(axis=0) - MARGIN) / resolution) * resolution
    size = np.ceil((corners.max(axis=0) + MARGIN - low) / resolution)
    columns, rows = int(size[0]), int(size[1])
    if columns * rows > MAX_PIXELS:
        raise BadInput(
            f"the map would have {columns} x {rows} cells, the limit is {MAX_PIXELS:,}: take a coarser resolution "
            f"than {resolution:g} m"
        )
    occupied = np.zeros((rows, columns), np.bool_)
    for outline in outlines:
        _fill(occupied, (outline - low) / resolution)
    return WorldMap(occupied[::-1], resolution, (float(low[0]), float(low[1])))


def _fill(cells: NDArray[np.bool_], outline: Floats) -> None:
    """Fill a convex polygon with corners in cells from the lower left: cells whose centre is inside, and those on its
    edges where it is thinner than a cell.
    """
    first = np.maximum(np.floor(outline.min(axis=0) - 1e-9).astype(int), 0)
    last = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 1, cells.shape[::-1])
    x, y = np.arange(first[0], last[0]) + 0.5, (np.arange(first[1], last[1]) + 0.5)[:, None]
    edges = np.roll(outline, -1, axis=0) - outline
    inside = np.full((len(y), x.size), len(outline) > 2)
    if len(outline) > 2:
        for (a, b), (along, across) in zip(outline, edges, strict=True):
            inside &= along * (y - b) - across * (x - a) >= -1e-9
    ends = np.roll(outline, -1, axis=0)
    area = abs(float(np.sum(outline[:, 0] * ends[:, 1] - outline[:, 1] * ends[:, 0]))) / 2
    if area < np.linalg.norm(edges, axis=1).max(initial=0.0):
        for start, edge in zip(outline, edges, strict=True):
            steps = np.linspace(0, 1, 2 + int(2 * np.abs(edge).max()))[:, None]
            points = np.floor(start + steps * edge - 1e-9).astype(int) - first
            fits = ((points >= 0) & (points < inside.shape[::-1])).all(axis=1)
            inside[points[fits, 1], points[fits, 0]] = True
    cells[first[1] : last[1], first[0] : last[0]] |= inside


def _outlines(world: WorldDescription, low: float, high: float) -> Iterator[Floats]:
    """Yield the convex areas, shape (n, 2) [m], that are covered between two heights."""
    for body in world.all_bodies:
        if body.kind == "moving":
            continue
        for part in body.parts:
            if part.solid and not part.ground:
                mesh = placed(shape_mesh(part.shape), body.pose @ part.pose)
                yield from _slices(mesh, _is_convex(part, body.kind == "movable"), low, high)


def _is_convex(part: BodyPart, movable: bool) -> bool:
    return movable or not isinstance(part.shape, MeshShape) or part.shape.convex


def _slices(mesh: Mesh, convex: bool, low: float, high: float) -> Iterator[Floats]:
    """Yield the areas that a mesh covers between two heights: one for a convex mesh, one per triangle for others."""
    triangles = mesh.vertices[mesh.triangles]
    heights = triangles[:, :, 2]
    triangles = triangles[(heights.max(axis=1) >= low) & (heights.min(axis=1) <= high)]
    if convex:
        if len(triangles):
            points = np.concatenate([_clipped(each, low, high) for each in triangles])
            if len(points):
                yield convex_hull(points)
        return
    for each in triangles:
        points = _clipped(each, low, high)
        if len(points):
            yield convex_hull(points)


def _clipped(triangle: Floats, low: float, high: float) -> Floats:
    """Return the corners, seen from above, of the part of a triangle between two heights."""
    points = [corner for corner in triangle if low <= corner[2] <= high]
    for start, end in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
        for level in (low, high):
            if (start[2] - level) * (end[2] - level) < 0:
                points.append(start + (level - start[2]) / (end[2] - start[2]) * (end - start))
    return np.array(points)[:, :2] if points else np.zeros((0, 2))
