"""Reads meshes: STL (binary and ASCII), OBJ and DAE, within limits that are checked before decoding."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from messages.errors import BadInput
from models.input_file import read_limited

MAX_BYTES = 64 << 20
"""Maximum size of a mesh file [bytes]."""
MAX_TRIANGLES = 500_000
"""Maximum number of triangles of a mesh, after triangulation of polygons."""
MAX_EXTENT = 1e6
"""Maximum magnitude of a mesh's coordinates, in the file's unit."""

FORMATS = (".stl", ".obj", ".dae")
"""The supported formats, by lower-case file extension."""

HULL_DIRECTIONS = 256
"""Directions in which a convex hull extends as far as its mesh; a sphere loses 0.8 % of its radius between two."""

_STL_HEADER, _STL_TRIANGLE = 84, 50
_LOOKS = (
    "library_effects",
    "library_materials",
    "library_images",
    "library_cameras",
    "library_lights",
    "library_animations",
    "bind_material",
    "instance_camera",
    "instance_light",
    "extra",
)
"""DAE elements that do not describe shapes."""


class BadMesh(BadInput):
    """A mesh cannot be read or exceeds the limits; the text names the file and the reason."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: ``vertices`` of shape (n, 3), in metres unless scaled, ``triangles`` of shape (m, 3)."""

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Minimum and maximum corner of its bounding box, shape (2, 3)."""
        bounds: NDArray[np.float64] = np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])
        return bounds

    def scaled(self, x: float, y: float, z: float) -> Mesh:
        """Scale each axis by a factor; an odd number of negative factors mirrors it, so that triangles are reversed."""
        turned = self.triangles[:, ::-1] if x * y * z < 0 else self.triangles
        return Mesh(self.vertices * np.array((x, y, z)), turned)


def read_mesh(path: Path) -> Mesh:
    """Read the mesh in a file; raises BadMesh.

    All groups, objects and nodes of a file are merged. In a DAE, the unit and the poses of its nodes are applied;
    ``up_axis`` is not, as in RViz and Gazebo.
    """
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise BadMesh(f"{path}: a mesh is one of {', '.join(FORMATS)}, not {kind or 'a file without an ending'}")
    try:
        content = read_limited(path, MAX_BYTES, "a mesh")
    except BadInput as error:
        raise BadMesh(str(error)) from None
    return decode_mesh(content, kind, str(path))


def decode_mesh(content: bytes, kind: str, where: str) -> Mesh:
    """Decode the content of a file with the extension ``kind``; ``where`` is used in errors. Raises BadMesh."""
    count, load = _FORMATS[kind]
    triangles = count(content, where)
    if triangles > MAX_TRIANGLES:
        raise BadMesh(f"{where}: the mesh has {triangles:,} triangles, the limit is {MAX_TRIANGLES:,}: simplify it")
    try:
        vertices, faces = load(content)
    except BadMesh as error:
        raise BadMesh(f"{where}: {error}") from None
    except (MemoryError, RecursionError):
        raise BadMesh(f"{where}: this {kind} file asks for more memory than a mesh may") from None
    except Exception as error:  # noqa: BLE001  (a foreign decoder on a foreign file: it may raise anything)
        raise BadMesh(f"{where}: this is not a readable {kind} file ({type(error).__name__}: {error})") from None
    return _checked(np.asarray(vertices, np.float64), np.asarray(faces), where)


def hull_points(mesh: Mesh) -> NDArray[np.float64]:
    """Return vertices that span the convex hull of a mesh, shape (k, 3), k at most ``HULL_DIRECTIONS``.

    They are the farthest vertices in directions spread evenly over the sphere (Fibonacci lattice), including the six
    axes, along which the hull is exact.
    """
    index = np.arange(HULL_DIRECTIONS - 6) + 0.5
    z = 1 - 2 * index / len(index)
    turn = math.pi * (1 + math.sqrt(5)) * index
    across = np.sqrt(1 - z * z)
    lattice = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    directions = np.concatenate([np.eye(3), -np.eye(3), lattice])
    farthest: set[int] = set()
    for each in np.array_split(directions, 16):
        farthest.update((mesh.vertices @ each.T).argmax(axis=0).tolist())
    points: NDArray[np.float64] = mesh.vertices[sorted(farthest)]
    return points


def write_stl(path: Path, mesh: Mesh) -> None:
    """Write a binary STL."""
    rows = np.zeros(len(mesh.triangles), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")]))
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    rows["corners"] = corners
    path.write_bytes(bytes(80) + len(rows).to_bytes(4, "little") + rows.tobytes())


def _checked(vertices: NDArray[np.float64], faces: NDArray[Any], where: str) -> Mesh:
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise BadMesh(f"{where}: the mesh has no triangle")
    if len(faces) > MAX_TRIANGLES:
        raise BadMesh(f"{where}: the mesh has {len(faces):,} triangles, the limit is {MAX_TRIANGLES:,}: simplify it")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise BadMesh(f"{where}: a triangle names a vertex that does not exist (of {len(vertices)})")
    used = vertices[np.unique(faces)]
    if not np.all(np.abs(used) <= MAX_EXTENT):
        raise BadMesh(f"{where}: a coordinate of the mesh is not a number up to {MAX_EXTENT:g}")
    return Mesh(vertices, faces.astype(np.int32))


def _is_binary_stl(content: bytes) -> bool:
    return len(content) >= _STL_HEADER and len(content) == _STL_HEADER + _STL_TRIANGLE * _stl_count(content)


def _stl_count(content: bytes) -> int:
    return int.from_bytes(content[80:84], "little")


def _count_stl(content: bytes, where: str) -> int:
    if _is_binary_stl(content):
        return _stl_count(content)
    if content.lstrip()[:5].lower() == b"solid":
        return len(re.findall(rb"\bfacet\b", content, re.IGNORECASE)) - len(
            re.findall(rb"\bendfacet\b", content, re.IGNORECASE)
        )
    if len(content) < _STL_HEADER:
        raise BadMesh(f"{where}: this is not an STL: it has {len(content)} bytes and does not begin with 'solid'")
    if _stl_count(content) > MAX_TRIANGLES:
        return _stl_count(content)
    size = _STL_HEADER + _STL_TRIANGLE * _stl_count(content)
    if len(content) < size:
        raise BadMesh(
            f"{where}: this STL is cut short: {_stl_count(content)} triangles take {size} bytes, it has {len(content)}"
        )
    return _stl_count(content)


def _load_stl(content: bytes) -> tuple[Any, Any]:
    if not _is_binary_stl(content) and content.lstrip()[:5].lower() != b"solid":
        # Some exporters append a few bytes.
        content = content[: _STL_HEADER + _STL_TRIANGLE * _stl_count(content)]
    return _load_by_trimesh(content, "stl")


def _count_obj(content: bytes, where: str) -> int:
    return sum(max(0, len(line.split()) - 3) for line in re.findall(rb"^[ \t]*f[ \t].*$", content, re.MULTILINE))


def _load_obj(content: bytes) -> tuple[Any, Any]:
    return _load_by_trimesh(content, "obj")


def _load_by_trimesh(content: bytes, kind: str) -> tuple[Any, Any]:
    import trimesh

    options = {"skip_materials": True, "group_material": False} if kind == "obj" else {}
    found = trimesh.load_mesh(io.BytesIO(content), file_type=kind, process=False, **options)
    return found.vertices, found.faces


def _count_dae(content: bytes, where: str) -> int:
    """Return the number of triangles stated in the attributes of a DAE, without building its tree."""
    parser, total = expat.ParserCreate(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal total
        if tag.rpartition(":")[2] in ("triangles", "polylist", "polygons", "trifans", "tristrips"):
            count = attributes.get("count", "0")
            total += int(count) if count.isdecimal() and len(count) < 12 else 0

    def refuse(*_: object) -> NoReturn:
        raise BadMesh(f"{where}:{parser.CurrentLineNumber}: the DAE declares a document type or entities")

    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise BadMesh(f"{where}:{error.lineno}: this is not XML: {expat.ErrorString(error.code)}") from None
    return total


def _load_dae(content: bytes) -> tuple[Any, Any]:
    import collada

    ignored = [collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError, collada.common.DaeIncompleteError]
    document = collada.Collada(io.BytesIO(_shapes_of_dae(content)), ignore=ignored)
    if document.scene is None:
        raise BadMesh("the DAE has no scene: nothing in it is placed")
    vertices: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int64]] = []
    begin = 0
    for geometry in document.scene.objects("geometry"):
        for part in geometry.primitives():
            if hasattr(part, "triangleset"):
                part = part.triangleset()
            if (
                getattr(part, "vertex_index", None) is None
                or part.vertex is None
                or np.shape(part.vertex_index)[1:] != (3,)
            ):
                continue
            vertices.append(np.asarray(part.vertex, np.float64))
            faces.append(np.asarray(part.vertex_index, np.int64) + begin)
            begin += len(part.vertex)
            if sum(map(len, faces)) > MAX_TRIANGLES or begin > 3 * MAX_TRIANGLES:
                raise BadMesh(f"its nodes repeat geometry to more than {MAX_TRIANGLES:,} triangles")
    if not faces:
        raise BadMesh("the mesh has no triangle")
    return np.concatenate(vertices) * (document.assetInfo.unitmeter or 1.0), np.concatenate(faces)


def read_colours(path: Path, mesh: Mesh) -> NDArray[np.uint8] | None:
    """Return the colour of each triangle of ``mesh``, which was read from the DAE ``path``, shape (m, 4); None if its
    materials cannot be read or are only textures."""
    import collada

    try:
        content = io.BytesIO(read_limited(path, MAX_BYTES, "a mesh"))
        document = collada.Collada(content, ignore=[collada.common.DaeError])
        found = []
        for geometry in document.scene.objects("geometry"):
            for part in geometry.primitives():
                part = part.triangleset() if hasattr(part, "triangleset") else part
                diffuse = getattr(getattr(getattr(part, "material", None), "effect", None), "diffuse", None)
                rgb = diffuse[:3] if isinstance(diffuse, tuple) else (0.7, 0.7, 0.7)
                if len(np.shape(part.vertex_index)) == 2 and len(part.vertex_index[0]) == 3:
                    found.append(np.tile((*rgb, 1.0), (len(part.vertex_index), 1)))
        colours = np.concatenate(found)
    except Exception:  # noqa: BLE001  (colours are for show: a robot without them is grey)
        return None
    return (255 * np.clip(colours, 0, 1)).astype(np.uint8) if len(colours) == len(mesh.triangles) else None


def write_glb(path: Path, mesh: Mesh, colours: NDArray[np.uint8]) -> None:
    """Write a binary glTF whose triangles have ``colours``, shape (m, 4)."""
    import trimesh

    corners = mesh.vertices[mesh.triangles].reshape(-1, 3)
    shown = trimesh.Trimesh(
        corners,
        np.arange(len(corners)).reshape(-1, 3),
        vertex_colors=np.repeat(colours, 3, axis=0),
        process=False,
    )
    shown.export(path, file_type="glb")


def _shapes_of_dae(content: bytes) -> bytes:
    """Return the DAE without its appearance, which exporters often get wrong: geometry with a broken material would be
    missing."""
    root = ElementTree.fromstring(content)
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag.rpartition("}")[2] in _LOOKS:
                parent.remove(child)
    return ElementTree.tostring(root)


_FORMATS: dict[str, tuple[Callable[[bytes, str], int], Callable[[bytes], tuple[Any, Any]]]] = {
    ".stl": (_count_stl, _load_stl),
    ".obj": (_count_obj, _load_obj),
    ".dae": (_count_dae, _load_dae),
}
