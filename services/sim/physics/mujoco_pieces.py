"""Splits a triangle mesh into convex pieces, the only meshes that MuJoCo collides.

A closed component whose triangles all lie on its hull is a piece, and so are triangles that lie in a plane and fill
their outline; everything else is cut in two until it is one of these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.mesh import Mesh

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]

TOLERANCE = 0.001
"""m; deviation of a piece from the mesh, larger if there would be too many pieces."""
MAX_PIECES = 1000
FILLED = 0.99
"""Minimum share of a flat piece's hull that its triangles cover."""
_SAMPLE = 256
"""Triangles of a piece that are checked."""


def convex_pieces(mesh: Mesh) -> list[Mesh]:
    """Return pieces whose hulls cover the mesh and little else."""
    corners, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    triangles = index.ravel().astype(np.int32)[mesh.triangles]
    tolerance = TOLERANCE
    while (found := _cut(corners, triangles, tolerance)) is None:
        tolerance *= 4
    return [_part(corners, triangles[piece]) for piece in found]


def _cut(corners: Floats, triangles: NDArray[np.int32], tolerance: float) -> list[Numbers] | None:
    """Return the triangles of each piece; None if there are too many pieces."""
    pieces: list[Numbers] = []
    pending = [(each, _is_solid(corners, triangles[each])) for each in _components(len(corners), triangles)]
    while pending:
        piece, solid = pending.pop()
        if len(piece) == 1 or _is_convex(corners, triangles[piece], solid, tolerance):
            pieces.append(piece)
        else:
            middles = corners[triangles[piece]].mean(axis=1)
            axis = int(np.argmax(np.ptp(middles, axis=0)))
            order, half = np.argsort(middles[:, axis], kind="stable"), len(piece) // 2
            pending += [(piece[order[:half]], solid), (piece[order[half:]], solid)]
        if len(pieces) + len(pending) > MAX_PIECES:
            return None
    return pieces


def _components(corners: int, triangles: NDArray[np.int32]) -> list[Numbers]:
    """Return the triangles of each component connected by corners."""
    label = np.arange(corners)
    while True:
        least = label[triangles].min(axis=1)
        before = label.copy()
        for side in range(3):
            np.minimum.at(label, triangles[:, side], least)
        label = label[label]
        if (label == before).all():
            break
    of = label[triangles[:, 0]]
    return [np.flatnonzero(of == each) for each in np.unique(of)]


def _is_solid(corners: Floats, triangles: NDArray[np.int32]) -> bool:
    """Return whether triangles enclose a volume and face outward: each edge belongs to two, once in each direction."""
    edges = np.concatenate([triangles[:, (0, 1)], triangles[:, (1, 2)], triangles[:, (2, 0)]]).astype(np.int64)
    forward, backward = edges[:, 0] * len(corners) + edges[:, 1], edges[:, 1] * len(corners) + edges[:, 0]
    if len(np.unique(forward)) < len(forward) or not np.array_equal(np.sort(forward), np.sort(backward)):
        return False
    a, b, c = (corners[triangles[:, side]] for side in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) > 0


def _is_convex(corners: Floats, triangles: NDArray[np.int32], solid: bool, tolerance: float) -> bool:
    used = corners[np.unique(triangles)]
    a, b, c = (corners[triangles[:, side]] for side in range(3))
    across = np.cross(b - a, c - a)
    areas = np.linalg.norm(across, axis=1)
    largest = int(np.argmax(areas))
    if areas[largest] == 0:
        return True
    normal = across[largest] / areas[largest]
    heights = (used - a[largest]) @ normal
    if float(np.ptp(heights)) <= tolerance:
        return float(areas.sum()) / 2 >= FILLED * _outline_area(used, normal)
    if not solid:
        return False
    chosen = np.flatnonzero(areas > 0)
    chosen = chosen[:: max(1, len(chosen) // _SAMPLE)]
    normals = across[chosen] / areas[chosen, None]
    offsets = np.einsum("ij,ij->i", normals, a[chosen])
    return bool(((used @ normals.T).max(axis=0) - offsets <= tolerance).all())


def _outline_area(points: Floats, normal: Floats) -> float:
    """Return the area of the hull of points in a plane (Andrew's monotone chain)."""
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    u = np.cross(normal, first)
    u /= np.linalg.norm(u)
    flat = sorted(set(zip((points @ u).tolist(), (points @ np.cross(normal, u)).tolist(), strict=True)))

    def chain(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
        found: list[tuple[float, float]] = []
        for x, y in ordered:
            while len(found) > 1:
                (ax, ay), (bx, by) = found[-2], found[-1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                    break
                found.pop()
            found.append((x, y))
        return found[:-1]

    outline = np.array(chain(flat) + chain(flat[::-1])).reshape(-1, 2)
    x, y = outline.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def _part(corners: Floats, triangles: NDArray[np.int32]) -> Mesh:
    used, index = np.unique(triangles, return_inverse=True)
    return Mesh(corners[used], index.reshape(-1, 3).astype(np.int32))
