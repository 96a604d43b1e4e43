"""Extents of a robot's shapes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from messages.se3 import Pose3, Vector, rotate_inverse
from models import physics_urdf_path
from models.mesh import read_mesh
from models.shapes import LinkShapes, Shape, read_shapes
from models.urdf import RobotDescription, parse_urdf, parse_xml
from models.urdf_writer import extents, link_poses

DIRECTIONS = 72
"""Number of directions in which the circle around a robot is measured."""

PlacedShape = tuple[Shape, Pose3]
"""A shape, and the pose of its link in the root."""


def support(shape: Shape, frame: Pose3, direction: Vector) -> float:
    """Return the distance [m] that the shape of a link at ``frame`` extends along a unit vector from the origin."""
    local = np.array(rotate_inverse(frame.orientation, direction))
    start = sum(a * b for a, b in zip(frame.position, direction, strict=True))
    return start + float((shape.points @ local).max()) + shape.rounding


def solid_shapes(shapes: Mapping[str, LinkShapes]) -> Mapping[str, LinkShapes]:
    """Return the shapes with the engine's collision shapes: the visuals if no link of the robot has a collision."""
    if any(each.collisions for each in shapes.values()):
        return shapes
    return {link: replace(each, collisions=each.visuals) for link, each in shapes.items()}


def placed_shapes(robot: RobotDescription, shapes: Mapping[str, LinkShapes]) -> list[PlacedShape]:
    """Return all collision shapes of a robot with their link poses."""
    poses = link_poses(robot)
    return [(shape, poses[link]) for link, own in solid_shapes(shapes).items() for shape in own.collisions]


def circle_radius(placed: Iterable[PlacedShape]) -> float:
    """Return the radius [m] of the circle about the root's z axis that encloses these shapes; 0 without any."""
    angles = [math.tau * each / DIRECTIONS for each in range(DIRECTIONS)]
    return max(
        (support(shape, pose, (math.cos(a), math.sin(a), 0.0)) for shape, pose in placed for a in angles), default=0.0
    )


def lowest_point(placed: Iterable[PlacedShape]) -> float:
    """Return the height [m] of the lowest point of these shapes in the root's frame; 0 without any."""
    return min((bottom(shape, pose) for shape, pose in placed), default=0.0)


def bottom(shape: Shape, pose: Pose3) -> float:
    """Return the height [m] of the lowest point of a shape."""
    return -support(shape, pose, (0.0, 0.0, -1.0))


def vertical_extent(model: str) -> tuple[float, float]:
    """Return the lowest and highest point [m] of the robot ``model`` in its root's frame, with all joints at zero.

    The second is infinite for a robot without shapes, or if a mesh cannot be read. Raises ``models.UnknownModel``.
    """
    path = physics_urdf_path(model)
    text = path.read_text(encoding="utf-8")
    faults: list[str] = []
    shapes = read_shapes(parse_xml(text), lambda name: read_mesh(path.parent / name.removeprefix("file://")), faults)
    if faults or not any(each.any for each in shapes.values()):
        return 0.0, math.inf
    _, low, high = extents(parse_urdf(text), shapes)
    return low, high
