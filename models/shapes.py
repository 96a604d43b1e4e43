"""The shapes of a robot's links: a URDF's ``<collision>`` and ``<visual>`` elements, with their meshes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from messages.errors import BadInput
from messages.se3 import Pose3, Vector, quaternion_from_rpy, rotated_axes
from models.mesh import Mesh, hull_points
from models.urdf import MAX_VALUE, BadUrdf, line_of

Floats = NDArray[np.float64]

CIRCLE_POINTS = 64
"""Points on the rim of a cylinder; between two, the rim loses 0.1 % of the radius."""
MAX_SHAPES = 2000
"""Maximum number of shapes of a robot."""

GEOMETRIES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
}
"""The primitive shapes of a URDF and their attributes [m]."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One shape in the frame of its link.

    ``size`` holds the attributes of ``GEOMETRIES`` in their order, in m; for a mesh, its scale. ``mesh`` is already
    scaled. The shape is the hull of ``points`` (in the link's frame, shape (n, 3)), expanded by ``rounding`` [m].
    """

    kind: str
    size: tuple[float, ...]
    pose: Pose3
    rpy: Vector
    points: Floats
    rounding: float = 0.0
    file: str = ""
    mesh: Mesh | None = None
    colour: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class LinkShapes:
    """The collision and visual shapes of a link, and notes on what was left out."""

    collisions: tuple[Shape, ...] = ()
    visuals: tuple[Shape, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def any(self) -> tuple[Shape, ...]:
        """The collision shapes, or else the visual ones."""
        return self.collisions or self.visuals

    def box(self) -> Floats | None:
        """Return the corners [m] of the bounding box in the link's frame, shape (2, 3); None without shapes."""
        if not self.any:
            return None
        low = np.min([each.points.min(axis=0) - each.rounding for each in self.any], axis=0)
        high = np.max([each.points.max(axis=0) + each.rounding for each in self.any], axis=0)
        return np.array([low, high])


class UnreadMesh(BadUrdf):
    """A mesh of a URDF is missing or invalid."""


MeshReader = Callable[[str], Mesh]
"""Reads a mesh by its name in the URDF; raises BadInput."""


def read_shapes(robot: ElementTree.Element, read: MeshReader, faults: list[str] | None = None) -> dict[str, LinkShapes]:
    """Read the shapes of each link of a URDF; raises BadUrdf with the line.

    Meshes that ``read`` refuses are left out if there is a list of ``faults``, which receives the reasons.
    """
    colours = dict(_named_colours(robot))
    shapes = {each.get("name", ""): _link_shapes(each, read, colours, faults) for each in robot.findall("link")}
    if (count := sum(len(each.collisions) + len(each.visuals) for each in shapes.values())) > MAX_SHAPES:
        raise BadUrdf(f"the links have {count} shapes, the limit is {MAX_SHAPES}")
    return shapes


def placed(points: Floats, pose: Pose3) -> Floats:
    """Transform points from the frame at ``pose`` to its parent."""
    axes: Floats = np.array(rotated_axes(pose.orientation))
    found: Floats = points @ axes + np.array(pose.position)
    return found


def _link_shapes(
    link: ElementTree.Element, read: MeshReader, colours: dict[str, tuple[float, ...]], faults: list[str] | None
) -> LinkShapes:
    name, remarks = link.get("name", ""), []
    found: dict[str, list[Shape]] = {"collision": [], "visual": []}
    for element in link:
        if element.tag not in found:
            continue
        try:
            shape = _shape(element, read, colours, f"link {name!r}: {element.tag}")
        except UnreadMesh as error:
            if faults is None:
                raise
            faults.append(str(error))
            shape = "has no mesh"
        if isinstance(shape, Shape):
            found[element.tag].append(shape)
        else:
            remarks.append(f"line {line_of(element)}: link {name!r}: {element.tag} {shape}: it is left out")
    return LinkShapes(tuple(found["collision"]), tuple(found["visual"]), tuple(remarks))


def _shape(
    element: ElementTree.Element, read: MeshReader, colours: dict[str, tuple[float, ...]], where: str
) -> Shape | str:
    """Return the shape, or why there is none."""
    geometry = element.find("geometry")
    given = next(iter(geometry), None) if geometry is not None else None
    if given is None:
        return "has no geometry"
    where = f"line {line_of(given)}: {where}"
    origin = element.find("origin")
    x, y, z = _numbers(origin, "xyz", 3, where) if origin is not None and "xyz" in origin.attrib else (0.0, 0.0, 0.0)
    turn = _numbers(origin, "rpy", 3, where) if origin is not None and "rpy" in origin.attrib else (0.0, 0.0, 0.0)
    rpy = (turn[0], turn[1], turn[2])
    pose, colour = Pose3((x, y, z), quaternion_from_rpy(*rpy)), _colour(element, colours)
    if given.tag == "mesh":
        file = given.get("filename", "").strip()
        if not file:
            raise BadUrdf(f"{where}: the mesh has no filename")
        scale = _numbers(given, "scale", 3, where) if "scale" in given.attrib else (1.0, 1.0, 1.0)
        if not all(scale):
            raise BadUrdf(f"{where}: mesh scale={given.get('scale', '')[:60]!r}: a factor is 0")
        try:
            mesh = read(file).scaled(*scale)
        except BadInput as error:
            raise UnreadMesh(f"{where}: {error}") from None
        return Shape("mesh", scale, pose, rpy, placed(hull_points(mesh), pose), 0.0, file, mesh, colour)
    if given.tag not in GEOMETRIES:
        return f"is a {given.tag[:40]!r}, which is not a shape of a URDF"
    if given.tag == "box":
        size = _numbers(given, "size", 3, where)
    else:
        size = tuple(_numbers(given, each, 1, where)[0] for each in GEOMETRIES[given.tag])
    if min(size) < 0:
        raise BadUrdf(f"{where}: {given.tag} {' '.join(f'{each:g}' for each in size)}: a length is below 0")
    if min(size) == 0:
        return f"is a {given.tag} without extent"
    points, rounding = _primitive_points(given.tag, size)
    return Shape(given.tag, size, pose, rpy, placed(points, pose), rounding, colour=colour)


@lru_cache(256)
def _primitive_points(kind: str, size: tuple[float, ...]) -> tuple[Floats, float]:
    """Return points and a radius: the shape is the hull of the points, expanded by the radius."""
    if kind == "box":
        x, y, z = (each / 2 for each in size)
        return np.array([(i * x, j * y, k * z) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]), 0.0
    if kind == "sphere":
        return np.zeros((1, 3)), size[0]
    radius, half = size[0], size[1] / 2
    if kind == "capsule":
        return np.array([(0.0, 0.0, -half), (0.0, 0.0, half)]), radius
    turn = np.arange(CIRCLE_POINTS) * 2 * math.pi / CIRCLE_POINTS
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    ends = [np.column_stack([rim, np.full(CIRCLE_POINTS, z)]) for z in (-half, half)]
    return np.concatenate(ends), 0.0


def _numbers(element: ElementTree.Element, attribute: str, count: int, where: str) -> tuple[float, ...]:
    text = element.get(attribute)
    if text is None:
        raise BadUrdf(f"{where}: {element.tag} has no {attribute}")
    try:
        values = tuple(float(part) for part in text.split())
    except ValueError:
        values = ()
    if len(values) != count:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise BadUrdf(f"{where}: {element.tag} {attribute}={text[:60]!r} is not {expected}")
    if not all(abs(each) <= MAX_VALUE for each in values):
        raise BadUrdf(f"{where}: {element.tag} {attribute}={text[:60]!r} exceeds {MAX_VALUE:g}")
    return values


def _named_colours(robot: ElementTree.Element) -> Iterator[tuple[str, tuple[float, ...]]]:
    for each in robot.iter("material"):
        if (rgba := _rgba(each)) is not None:
            yield each.get("name", ""), rgba


def _colour(element: ElementTree.Element, colours: dict[str, tuple[float, ...]]) -> tuple[float, ...] | None:
    material = element.find("material")
    if material is None:
        return None
    own = _rgba(material)
    return own if own is not None else colours.get(material.get("name", ""))


def _rgba(material: ElementTree.Element) -> tuple[float, ...] | None:
    """Return the colour of a material; None if it is missing or invalid, which is not an error."""
    colour = material.find("color")
    try:
        parts = (
            tuple(min(1.0, max(0.0, float(each))) for each in colour.get("rgba", "").split())
            if colour is not None
            else ()
        )
    except ValueError:
        return None
    return parts if len(parts) == 4 and all(map(math.isfinite, parts)) else None
