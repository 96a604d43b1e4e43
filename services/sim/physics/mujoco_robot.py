"""A robot as simulated by MuJoCo: its links merged into rigid parts, each with mass, shapes and joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from messages.se3 import IDENTITY, Pose3, rotated_axes
from models.mesh import Mesh, read_mesh
from models.shapes import LinkShapes, Shape, read_shapes
from models.urdf import Inertia as LinkInertia
from models.urdf import Joint, RobotDescription, parse_urdf, parse_xml, read_urdf
from services.runtime.errors import BadInput
from services.sim.physics.inertia import inertia_matrix, principal_axes, principal_inertia
from services.sim.physics.world import Inertia

DEFAULT_FRICTION = 0.5
"""For a link without a ``<contact>``, as in PyBullet."""
MIN_MASS = 1e-6
"""kg; minimum mass of a moving part."""
MIN_MOMENT = 1e-9
"""kg m2; minimum moment of inertia."""


@dataclass(frozen=True, eq=False)
class PartShape:
    """A shape of a link at ``pose`` in its part; the link ``rolls`` if its collision shapes are spheres."""

    link: str
    shape: Shape
    pose: Pose3
    rolls: bool
    friction: float


@dataclass(frozen=True, eq=False)
class Part:
    """Links held together by fixed joints.

    Its frame is that of the first link, at ``pose`` in the part ``parent`` when ``joint`` is at zero. The root has
    parent -1 and no joint.
    """

    parent: int
    joint: Joint | None
    pose: Pose3
    mass: float
    centre: Pose3
    moments: tuple[float, ...]
    collisions: tuple[PartShape, ...]
    visuals: tuple[PartShape, ...]


@dataclass(frozen=True, eq=False)
class RobotTree:
    """The parts of a robot, each after its parent, in the engine's order.

    ``links`` has the part of each link and its pose in it; ``joints`` has the movable ones in the URDF's order, each
    with the index of its part.
    """

    parts: tuple[Part, ...]
    links: dict[str, tuple[int, Pose3]]
    joints: dict[str, int]
    inertias: dict[str, Inertia]
    reach: float
    """m; nothing of the robot is ever farther from the root's origin."""

    def damping(self, joint: str) -> float:
        """Return the URDF's damping of a joint, N m s/rad or N s/m."""
        moved_by = self.parts[self.joints[joint]].joint
        assert moved_by is not None
        return moved_by.limits.damping


def read_tree(urdf: Path) -> RobotTree:
    """Read the parts of the robot in a URDF file; raises BadInput if it cannot be read."""
    try:
        return _read_tree(urdf, urdf.stat().st_mtime_ns)
    except (BadInput, OSError) as error:
        raise BadInput(f"{urdf}: MuJoCo cannot load this URDF: {error}") from error


@lru_cache(64)
def _read_tree(urdf: Path, _: int) -> RobotTree:
    text = read_urdf(urdf)
    xml, robot = parse_xml(text), parse_urdf(text)
    shapes = read_shapes(xml, lambda file: _mesh(urdf, file))
    return _Joining(robot, shapes, _frictions(xml)).tree()


def _mesh(urdf: Path, file: str) -> Mesh:
    return read_mesh(urdf.parent / file.removeprefix("file://"))


def _frictions(xml: ElementTree.Element) -> dict[str, float]:
    found = {}
    for link in xml.findall("link"):
        tag = link.find("contact/lateral_friction")
        if tag is not None:
            found[link.get("name", "")] = float(tag.get("value", DEFAULT_FRICTION))
    return found


class _Joining:
    """Walks through a robot's links from the root on, children in the URDF's order, and merges them into parts."""

    def __init__(self, robot: RobotDescription, shapes: dict[str, LinkShapes], friction: dict[str, float]) -> None:
        self._robot, self._shapes, self._friction = robot, shapes, friction
        self._links = {each.name: each for each in robot.links}
        self._children: dict[str, list[Joint]] = {}
        for joint in robot.joints:
            self._children.setdefault(joint.parent, []).append(joint)
        self._parts: list[Part] = []
        self._places: dict[str, tuple[int, Pose3]] = {}
        self._moved_by: dict[str, int] = {}

    def tree(self) -> RobotTree:
        self._add(self._robot.root, -1, None, IDENTITY)
        joints = [each.name for each in self._robot.joints if each.name in self._moved_by]
        first = [self._robot.root, *(each.child for each in self._robot.joints)]
        return RobotTree(
            parts=tuple(self._parts),
            links={link: self._places[link] for link in first},
            joints={name: self._moved_by[name] for name in joints},
            inertias={name: self._inertia(name) for name in first},
            reach=self._reach(),
        )

    def _add(self, link: str, parent: int, joint: Joint | None, pose: Pose3) -> None:
        """Add the part that begins with a link, then the parts below it."""
        number = len(self._parts)
        if joint is not None:
            self._moved_by[joint.name] = number
        held, hanging, pending = [], [], [(link, IDENTITY)]
        while pending:
            name, place = pending.pop(0)
            self._places[name] = number, place
            held.append((name, place))
            for each in self._children.get(name, ()):
                if each.single_dof:
                    hanging.append((each, place))
                else:
                    pending.append((each.child, place @ each.transform()))
        self._parts.append(self._part(held, parent, joint, pose))
        for each, place in hanging:
            self._add(each.child, number, each, place @ each.transform())

    def _part(self, held: list[tuple[str, Pose3]], parent: int, joint: Joint | None, pose: Pose3) -> Part:
        mass, centre, tensor = _combined([(self._links[name].inertia, place) for name, place in held])
        moments, axes = principal_axes(tensor)
        collisions, visuals = [], []
        for name, place in held:
            shapes, friction = self._shapes[name], self._friction.get(name, DEFAULT_FRICTION)
            rolls = bool(shapes.collisions) and all(each.kind == "sphere" for each in shapes.collisions)
            collisions += [PartShape(name, each, place @ each.pose, rolls, friction) for each in shapes.collisions]
            visuals += [PartShape(name, each, place @ each.pose, rolls, friction) for each in shapes.visuals]
        return Part(
            parent=parent,
            joint=joint,
            pose=pose,
            mass=max(mass, MIN_MASS),
            centre=Pose3(centre, axes),
            moments=tuple(max(each, MIN_MOMENT) for each in moments),
            collisions=tuple(collisions),
            visuals=tuple(visuals),
        )

    def _inertia(self, name: str) -> Inertia:
        """Return the inertia of a link about its principal axes."""
        return principal_inertia(self._links[name].inertia, self._friction.get(name, DEFAULT_FRICTION))

    def _reach(self) -> float:
        farthest, starts = 0.0, [0.0] * len(self._parts)
        for number, part in enumerate(self._parts):
            if part.joint is not None:
                slides = part.joint.kind == "prismatic"
                limits = part.joint.limits
                travel = max(abs(limits.lower or 0.0), abs(limits.upper or 0.0)) if slides else 0.0
                starts[number] = starts[part.parent] + math.hypot(*part.pose.position) + travel
            for each in (*part.collisions, *part.visuals):
                # Points are in the link's frame; so is the shape's own pose.
                link = self._places[each.link][1]
                extent = float(np.linalg.norm(each.shape.points, axis=1).max()) + each.shape.rounding
                farthest = max(farthest, starts[number] + math.hypot(*link.position) + extent)
        return farthest


def _combined(
    inertias: list[tuple[LinkInertia, Pose3]],
) -> tuple[float, tuple[float, float, float], NDArray[np.float64]]:
    """Return mass [kg], centre [m] and tensor [kg m2] about it, of links at poses in a common frame, in its axes."""
    mass = sum(each.mass for each, _ in inertias)
    places = [place @ each.centre for each, place in inertias]
    points = np.array([place.position for place in places])
    weights = np.array([each.mass for each, _ in inertias])
    centre = weights @ points / mass if mass > 0 else np.zeros(3)
    tensor = np.zeros((3, 3))
    for (each, _), place, point in zip(inertias, places, points - centre, strict=True):
        axes = np.array(rotated_axes(place.orientation)).T
        tensor += axes @ inertia_matrix(each.tensor) @ axes.T
        tensor += each.mass * (point @ point * np.eye(3) - np.outer(point, point))
    x, y, z = centre.tolist()
    return mass, (x, y, z), tensor
