"""The meshes and height maps of one world, each file read once, with common limits."""

from __future__ import annotations

from pathlib import Path

from messages.errors import BadInput
from messages.se3 import Vector
from models.bodies import HeightMapShape, MeshShape
from models.height_map import read_heights
from models.mesh import Mesh, read_mesh

MAX_TRIANGLES = 2_000_000
"""Maximum number of triangles of all meshes of a world, counting repeated use; they take 0.4 GB."""
MAX_SAMPLES = 4_000_000
"""Maximum number of pixels of all height maps of a world."""


class WorldMeshes:
    """Reads the meshes and height maps that a world's file refers to."""

    def __init__(self) -> None:
        self._meshes: dict[Path, Mesh] = {}
        self._scaled: dict[tuple[Path, Vector], Mesh] = {}
        self._triangles = self._samples = 0

    def mesh(self, file: Path, scale: Vector, convex: bool = False) -> MeshShape:
        """Return the mesh in a file, scaled; raises BadInput."""
        if 0 in scale:
            raise BadInput("a mesh cannot be scaled by 0")
        if file not in self._meshes:
            self._meshes[file] = read_mesh(file)
        if (file, scale) not in self._scaled:
            self._scaled[file, scale] = self._meshes[file].scaled(*scale)
        mesh = self._scaled[file, scale]
        self._triangles += len(mesh.triangles)
        if self._triangles > MAX_TRIANGLES:
            raise BadInput(f"the meshes of the world have more than {MAX_TRIANGLES:,} triangles: simplify them")
        return MeshShape(mesh, file, scale, convex)

    def height_map(
        self, file: Path, height: tuple[float, float], size: tuple[float, float] | None, resolution: float = 1.0
    ) -> HeightMapShape:
        """Return the height map in an image, see ``models.height_map``; it covers ``size`` [m], or has ``resolution``
        [m] per pixel. Raises BadInput."""
        shape = read_heights(file, height)
        rows, columns = shape.heights.shape
        self._samples += rows * columns
        if self._samples > MAX_SAMPLES:
            raise BadInput(f"the height maps of the world have more than {MAX_SAMPLES:,} pixels: scale them down")
        return HeightMapShape(shape.heights, size or ((columns - 1) * resolution, (rows - 1) * resolution))
