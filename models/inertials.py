"""Repairs masses and inertias of a robot's links that are missing or physically impossible.

The engine needs both for each link: it assumes 1 kg for a link without a mass, and a point mass for a tensor it
rejects.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from messages.errors import list_names
from messages.se3 import Pose3
from models.mass_properties import box_inertia
from models.shapes import LinkShapes
from models.urdf import MAX_VALUE, BadUrdf, Inertia, RobotDescription

DENSITY = 200.0
"""Assumed density [kg/m3] of a link's bounding box. A TurtleBot3 Burger has 212, a Pioneer 3-DX 239."""
TOKEN_MASS, TOKEN_MOMENT = 1e-4, 1e-8
"""Mass [kg] and moment [kg m2] of a frame without a body: negligible beside the link that it is fixed to."""
LEAST_MASS = 0.01
"""Mass [kg] of a movable body without mass and shape."""
LEAST_SIDE = 0.01
"""Minimum side [m] of a link's box, so that its tensor is physically possible."""
ROUNDING = 0.01
"""Relative tolerance of the triangle inequality of moments, for rounded values of thin plates."""


@dataclass(frozen=True)
class RepairedInertias:
    """The inertia of each link for the engine, and notes on the assumptions made."""

    inertias: Mapping[str, Inertia]
    notes: tuple[str, ...]


def repair_inertias(robot: RobotDescription, shapes: Mapping[str, LinkShapes]) -> RepairedInertias:
    """Return physically possible inertias; raises BadUrdf for masses or inertias beyond MAX_VALUE.

    Links connected by fixed joints are one body, in which a link without mass is a frame. A body without any mass gets
    that of its shapes at ``DENSITY``. An impossible tensor is replaced by the nearest possible one: without its
    products of inertia, or else that of the link's bounding box.
    """
    found: dict[str, Inertia] = {}
    assumed: list[str] = []
    negative: list[str] = []
    dropped: list[str] = []
    boxed: list[str] = []
    given = {each.name: each.inertia for each in robot.links}
    for name, inertia in given.items():
        if inertia.mass > MAX_VALUE or any(abs(each) > MAX_VALUE for each in inertia.tensor):
            raise BadUrdf(f"link {name!r}: its mass or inertia exceeds {MAX_VALUE:g}")
        if inertia.mass < 0:
            negative.append(name)
    for body in _bodies(robot):
        if all(given[each].mass <= 0 for each in body):
            masses = {each: _assumed_mass(shapes[each]) for each in body}
            if not any(masses.values()) and body[0] != robot.root:
                masses[body[0]] = LEAST_MASS
            for each, mass in masses.items():
                if mass:
                    found[each] = _box_inertia(mass, shapes[each])
                    assumed.append(f"{each} {mass:.3g} kg")
        for each in body:
            if each not in found:
                found[each] = _repaired(given[each], shapes[each], each, dropped, boxed)
    notes = [
        (assumed, f"without mass, which is estimated from their shapes at {DENSITY:g} kg/m3"),
        (negative, "with a negative mass, which counts as missing"),
        (dropped, "with impossible products of inertia, which are set to 0"),
        (boxed, "with an impossible inertia, which is replaced by that of their bounding box"),
    ]
    return RepairedInertias(found, tuple(f"links {what}: {listed(names)}" for names, what in notes if names))


def listed(names: Iterable[str], most: int = 8) -> str:
    """Join the names, at most the first ``most``."""
    return list_names(list(names), most)


def _bodies(robot: RobotDescription) -> list[list[str]]:
    """Return the groups of links connected by fixed joints, each starting with its uppermost link."""
    held: dict[str, list[str]] = {}
    for joint in robot.joints:
        if joint.kind not in ("revolute", "continuous", "prismatic"):
            held.setdefault(joint.parent, []).append(joint.child)
    fixed = {child for children in held.values() for child in children}
    bodies = []
    for link in robot.links:
        if link.name in fixed:
            continue
        body = [link.name]
        for each in body:
            body += held.get(each, [])
        bodies.append(body)
    return bodies


def _assumed_mass(shapes: LinkShapes) -> float:
    box = shapes.box()
    if box is None:
        return 0.0
    return round(min(1000.0, max(0.001, DENSITY * float(np.prod(np.maximum(box[1] - box[0], 1e-3))))), 6)


def _repaired(given: Inertia, shapes: LinkShapes, name: str, dropped: list[str], boxed: list[str]) -> Inertia:
    if given.mass <= 0:
        return Inertia(TOKEN_MASS, tensor=(TOKEN_MOMENT,) * 3 + (0.0,) * 3)
    if _is_possible(given.tensor):
        return given
    xx, yy, zz, *_ = given.tensor
    if _is_possible((xx, yy, zz, 0.0, 0.0, 0.0)):
        dropped.append(name)
        return replace(given, tensor=(xx, yy, zz, 0.0, 0.0, 0.0))
    boxed.append(name)
    return replace(_box_inertia(given.mass, shapes), centre=Pose3(given.centre.position, (0.0, 0.0, 0.0, 1.0)))


def _is_possible(tensor: tuple[float, ...]) -> bool:
    """Whether the principal moments are positive and none exceeds the sum of the others."""
    xx, yy, zz, xy, xz, yz = tensor
    low, middle, high = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])).tolist()
    return bool(low > 0 and high <= (low + middle) * (1 + ROUNDING))


def _box_inertia(mass: float, shapes: LinkShapes) -> Inertia:
    """Return the inertia of the homogeneous bounding box of these shapes."""
    box = shapes.box()
    low, high = (np.zeros(3), np.full(3, _cube_side(mass))) if box is None else (box[0], box[1])
    centre = (low + high) / 2 if box is not None else np.zeros(3)
    x, y, z = np.maximum(high - low, LEAST_SIDE).tolist()
    px, py, pz = centre.tolist()
    return Inertia(mass, Pose3((px, py, pz), (0.0, 0.0, 0.0, 1.0)), (*box_inertia(mass, (x, y, z)), 0.0, 0.0, 0.0))


def _cube_side(mass: float) -> float:
    return math.cbrt(mass / DENSITY)
