"""Writes an imported robot's URDF twice: for the physics engine and for the viewer.

Both keep the links and joints of the original, with its order and names. What strict parsers need is added: an inertia
for each link, limits for each joint, colours inside the visuals that use them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from messages.se3 import IDENTITY, Pose3, rotate_inverse, rpy_from_quaternion
from models.inertials import listed
from models.mesh import Mesh, hull_points, read_colours, write_glb, write_stl
from models.shapes import GEOMETRIES, LinkShapes, Shape, placed
from models.urdf import Inertia, Joint, RobotDescription

ROUND = 0.05
"""Relative tolerance of a wheel's shape from a circle, and of its height above the lowest point of all shapes."""
MAX_TILT = 0.1
"""Sine of the maximum angle between a wheel's axis and the horizontal; some have camber."""
GREY = (0.7, 0.7, 0.7, 1.0)
"""The colour of a shape without one."""


class EngineFiles:
    """Writes the engine's meshes into a folder that will be renamed to ``final`` before they are read."""

    def __init__(self, folder: Path, final: Path) -> None:
        self._folder, self._final, self._written = folder, final, 0

    def write(self, mesh: Mesh) -> str:
        """Write a mesh; return its path."""
        self._written += 1
        name = f"mesh_{self._written}.stl"
        write_stl(self._folder / name, mesh)
        return str(self._final / name)

    def write_coloured(self, mesh: Mesh, colours: NDArray[np.uint8]) -> str:
        """Write a mesh with the colours of its triangles; return its path."""
        self._written += 1
        name = f"mesh_{self._written}.glb"
        write_glb(self._folder / name, mesh, colours)
        return str(self._final / name)


def physics_urdf(
    robot: RobotDescription,
    shapes: Mapping[str, LinkShapes],
    inertias: Mapping[str, Inertia],
    contacts: Mapping[str, ElementTree.Element],
    files: EngineFiles,
) -> tuple[str, tuple[str, ...]]:
    """Return the URDF for the engine, and notes on the assumptions made.

    Each mesh collides as its convex hull. A wheel on the ground collides as a sphere: measured, a cylinder makes a base
    up to 3 % faster or slower than commanded. If no link has a collision, the visuals collide. Unsupported joints are
    fixed.

    Args:
        robot: The description.
        shapes: The shapes of its links.
        inertias: The inertia of each link, physically possible.
        contacts: The ``<contact>`` of links that have one, which PyBullet reads.
        files: Where meshes are written.
    """
    notes = []
    own = {name: each.collisions for name, each in shapes.items()}
    if not any(own.values()) and any(each.visuals for each in shapes.values()):
        own = {name: each.visuals for name, each in shapes.items()}
        notes.append("no link has a <collision>: the visuals collide, each mesh as its convex hull")
    elif not any(own.values()):
        notes.append("no link has a shape: the robot touches nothing, and falls unless it is fixed")
    wheels = find_wheels(robot, own)
    if wheels:
        notes.append(f"wheels simulated as spheres of their radius: {listed(wheels)}")
    root = ElementTree.Element("robot", name=robot.name or "robot")
    for link in robot.links:
        element = ElementTree.SubElement(root, "link", name=link.name)
        if link.name in contacts:
            element.append(contacts[link.name])
        _add_inertial(element, inertias[link.name])
        for shape in shapes[link.name].visuals:
            _add_shape(element, "visual", shape, files.write(shape.mesh) if shape.mesh is not None else "")
        if (wheel := wheels.get(link.name)) is not None:
            _add_sphere(element, *wheel)
            continue
        for shape in own[link.name]:
            _add_shape(element, "collision", shape, files.write(_hull(shape.mesh)) if shape.mesh is not None else "")
    odd = [each.name for each in robot.joints if each.kind in ("floating", "planar")]
    if odd:
        notes.append(f"floating and planar joints, which are fixed here: {listed(odd)}")
    followers = [each.name for each in robot.joints if each.mimic is not None]
    if followers:
        notes.append(f"joints that mimic others, which move freely here as in Gazebo: {listed(followers)}")
    for joint in robot.joints:
        root.append(_joint(joint, "fixed" if joint.kind in ("floating", "planar") else joint.kind))
    return _text(root), tuple(notes)


def viewer_urdf(
    robot: RobotDescription, shapes: Mapping[str, LinkShapes], named: Mapping[str, Path], files: EngineFiles
) -> str:
    """Return the URDF for the viewer; if there are no visuals, the collision shapes are displayed.

    Meshes are the user's files except DAE, of which the viewer supports only some, without units: they are rewritten
    with the colours of their materials. ``named`` maps the names of files in the URDF to paths.
    """
    root = ElementTree.Element("robot", name=re.sub(r"\W+", "_", robot.name) or "robot")
    seen = any(each.visuals for each in shapes.values())
    for link in robot.links:
        element = ElementTree.SubElement(root, "link", name=link.name)
        for shape in shapes[link.name].visuals if seen else shapes[link.name].collisions:
            if shape.mesh is None or named[shape.file].suffix.lower() != ".dae":
                _add_shape(element, "visual", shape, shape.file)
                continue
            colours = read_colours(named[shape.file], shape.mesh) if shape.colour is None else None
            file = files.write(shape.mesh) if colours is None else files.write_coloured(shape.mesh, colours)
            _add_shape(element, "visual", shape, file, coloured=colours is not None)
    for joint in robot.joints:
        root.append(_joint(joint, joint.kind))
    return _text(root)


def find_wheels(
    robot: RobotDescription, collisions: Mapping[str, Iterable[Shape]]
) -> dict[str, tuple[tuple[float, float, float], float]]:
    """Return the wheel links, each with centre [m, in its frame] and radius [m] of the sphere that replaces it.

    A wheel is on a continuous joint with a horizontal axis, is circular about it, and touches the ground: it reaches as
    low as the lowest shape of the robot, with all joints at zero.
    """
    places = link_poses(robot)
    lowest = min((_bottom(shape, places[name]) for name, each in collisions.items() for shape in each), default=0.0)
    found = {}
    for joint in robot.joints:
        shapes = list(collisions[joint.child])
        place = places[joint.child]
        upward = rotate_inverse(place.orientation, (0.0, 0.0, 1.0))
        level = abs(sum(up * axis for up, axis in zip(upward, joint.axis, strict=True))) < MAX_TILT
        if joint.kind != "continuous" or not level or len(shapes) != 1 or shapes[0].kind == "sphere":
            continue
        wheel = _round_about(shapes[0], np.array(joint.axis))
        if wheel is None:
            continue
        centre, radius = wheel
        bottom = placed(np.array([centre]), place)[0, 2] - radius
        if bottom <= lowest + ROUND * radius:
            found[joint.child] = ((float(centre[0]), float(centre[1]), float(centre[2])), radius)
    return found


def link_poses(robot: RobotDescription) -> dict[str, Pose3]:
    """Return the pose of each link in the root, with all joints at zero."""
    below: dict[str, list[Joint]] = {}
    for joint in robot.joints:
        below.setdefault(joint.parent, []).append(joint)
    places, pending = {robot.root: IDENTITY}, [robot.root]
    for link in pending:
        for joint in below.get(link, []):
            places[joint.child] = places[link] @ joint.transform()
            pending.append(joint.child)
    return places


def extents(robot: RobotDescription, shapes: Mapping[str, LinkShapes]) -> tuple[float, float, float]:
    """Return the robot's extent from the root's z axis, its lowest and its highest point [m], with all joints at zero;
    the lowest is that of the collision shapes. Zeros without shapes."""
    places, colliding = link_poses(robot), any(each.collisions for each in shapes.values())
    reach, high, low = 0.0, 0.0, math.inf
    for name, each in shapes.items():
        for shape in (*each.collisions, *each.visuals):
            points = placed(shape.points, places[name])
            reach = max(reach, float(np.hypot(points[:, 0], points[:, 1]).max()) + shape.rounding)
            high = max(high, float(points[:, 2].max()) + shape.rounding)
        for shape in each.collisions if colliding else each.visuals:
            low = min(low, _bottom(shape, places[name]))
    return reach, low if math.isfinite(low) else 0.0, high


def _bottom(shape: Shape, place: Pose3) -> float:
    return float(placed(shape.points, place)[:, 2].min()) - shape.rounding


def _round_about(shape: Shape, axis: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return centre and radius of a shape that is circular about an axis; None for any other."""
    points = shape.points
    along = points @ axis
    one = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    one /= np.linalg.norm(one)
    other = np.cross(axis, one)
    turns = np.linspace(0.0, math.pi, 8, endpoint=False)
    directions = np.cos(turns)[:, None] * one + np.sin(turns)[:, None] * other
    across = points @ directions.T
    widths = across.max(axis=0) - across.min(axis=0)
    radius = shape.size[0] if shape.kind == "cylinder" else float(widths.max()) / 2 + shape.rounding
    if radius <= 0 or widths.max() - widths.min() > 2 * ROUND * radius:
        return None
    if along.max() - along.min() > 4 * radius:
        return None
    flat = points - np.outer(along, axis)
    centre = flat @ np.array([one, other]).T
    middle = (centre.max(axis=0) + centre.min(axis=0)) / 2
    if float(np.hypot(*middle)) > ROUND * radius:
        return None
    return middle @ np.array([one, other]) + axis * (along.max() + along.min()) / 2, radius


def _hull(mesh: Mesh) -> Mesh:
    """Return triangles through the points that span the hull; the engine computes the hull of their vertices."""
    points = hull_points(mesh)
    index = np.arange(3 * math.ceil(len(points) / 3)) % len(points)
    return Mesh(points, index.reshape(-1, 3).astype(np.int32))


def _add_inertial(link: ElementTree.Element, inertia: Inertia) -> None:
    element = ElementTree.SubElement(link, "inertial")
    _add_origin(element, inertia.centre.position, rpy_from_quaternion(inertia.centre.orientation))
    ElementTree.SubElement(element, "mass", value=repr(inertia.mass))
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    ElementTree.SubElement(element, "inertia", dict(zip(names, map(repr, inertia.tensor), strict=True)))


def _add_shape(link: ElementTree.Element, tag: str, shape: Shape, file: str, coloured: bool = False) -> None:
    element = ElementTree.SubElement(link, tag)
    _add_origin(element, shape.pose.position, shape.rpy)
    geometry = ElementTree.SubElement(element, "geometry")
    if shape.kind == "mesh":
        # The engine's meshes are already scaled; the viewer's are the originals.
        scale = {"scale": _numbers(shape.size)} if file == shape.file else {}
        ElementTree.SubElement(geometry, "mesh", {"filename": file, **scale})
    elif shape.kind == "box":
        ElementTree.SubElement(geometry, "box", size=_numbers(shape.size))
    else:
        names = GEOMETRIES[shape.kind]
        ElementTree.SubElement(geometry, shape.kind, dict(zip(names, map(repr, shape.size), strict=True)))
    if tag == "visual" and not coloured:
        rgba = shape.colour or GREY
        material = ElementTree.SubElement(element, "material", name=f"rgba_{'_'.join(f'{each:g}' for each in rgba)}")
        ElementTree.SubElement(material, "color", rgba=_numbers(rgba))


def _add_sphere(link: ElementTree.Element, centre: tuple[float, float, float], radius: float) -> None:
    element = ElementTree.SubElement(link, "collision")
    _add_origin(element, centre, (0.0, 0.0, 0.0))
    ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), "sphere", radius=repr(radius))


def _joint(joint: Joint, kind: str) -> ElementTree.Element:
    element = ElementTree.Element("joint", name=joint.name, type=kind)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    _add_origin(element, joint.xyz, joint.rpy)
    if kind != "fixed":
        ElementTree.SubElement(element, "axis", xyz=_numbers(joint.axis))
        limits = joint.limits
        figures = {"effort": limits.effort, "velocity": limits.velocity}
        bounds = {"lower": limits.lower, "upper": limits.upper} if kind in ("revolute", "prismatic") else {}
        given = {name: repr(0.0 if value is None else value) for name, value in {**bounds, **figures}.items()}
        ElementTree.SubElement(element, "limit", given)
        ElementTree.SubElement(element, "dynamics", damping=repr(limits.damping), friction=repr(limits.friction))
    return element


def _add_origin(element: ElementTree.Element, xyz: Iterable[float], rpy: Iterable[float]) -> None:
    ElementTree.SubElement(element, "origin", xyz=_numbers(xyz), rpy=_numbers(rpy))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(each)) for each in values)


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=False) + "\n"
