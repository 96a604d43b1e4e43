"""How far down and up a robot reaches, by the shapes of its URDF."""

from __future__ import annotations

import math

from models import physics_urdf_path
from models.mesh import read_mesh
from models.shapes import read_shapes
from models.urdf import parse_urdf, parse_xml
from models.urdf_writer import extents


def vertical_extent(model: str) -> tuple[float, float]:
    """The lowest and the highest point [m] of the robot ``model`` in its root's frame, all joints at zero.

    The second is infinite for a robot without shapes, and where a mesh cannot be read. Raises ``models.UnknownModel``.
    """
    path = physics_urdf_path(model)
    text = path.read_text(encoding="utf-8")
    faults: list[str] = []
    shapes = read_shapes(parse_xml(text), lambda name: read_mesh(path.parent / name.removeprefix("file://")), faults)
    if faults or not any(each.any for each in shapes.values()):
        return 0.0, math.inf
    _, low, high = extents(parse_urdf(text), shapes)
    return low, high
