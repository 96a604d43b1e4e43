"""How far down and up a robot reaches, by the collision shapes of its URDF."""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from messages.se3 import IDENTITY, Pose3, quaternion_from_rpy, rotated_axes
from models import urdf_path
from models.robot_cache import is_made
from models.robot_facts import read_facts
from models.urdf import parse_xml, read_joints


def vertical_extent(model: str) -> tuple[float, float]:
    """The lowest and the highest point [m] of the robot ``model`` in its root's frame, all joints at zero.

    Of a robot of this folder, a shape whose size is not in the URDF may reach to any height: the second is infinite
    then, as it is without collision shapes. The meshes of one from outside were measured when its files were made.
    Raises ``models.UnknownModel``.
    """
    if is_made(model):
        facts = read_facts(model)
        return facts.lowest, facts.highest
    root = parse_xml(urdf_path(model).read_text(encoding="utf-8"))
    poses = {joint.child: (joint.parent, joint.transform()) for joint in read_joints(model)}
    spans = [
        _span(_link_pose(link.get("name", ""), poses) @ _origin(collision), shape)
        for link in root.iterfind("link")
        for collision in link.iterfind("collision")
        for shape in _shapes(collision)
    ]
    return (min(low for low, _ in spans), max(high for _, high in spans)) if spans else (0.0, math.inf)


def _link_pose(link: str, poses: dict[str, tuple[str, Pose3]]) -> Pose3:
    place = IDENTITY
    while link in poses:
        link, mount = poses[link]
        place = mount @ place
    return place


def _shapes(collision: Element) -> Iterator[Element]:
    for geometry in collision.iterfind("geometry"):
        yield from geometry


def _origin(element: Element) -> Pose3:
    origin = element.find("origin")
    x, y, z = _numbers(origin, "xyz")
    return Pose3((x, y, z), quaternion_from_rpy(*_numbers(origin, "rpy")))


def _numbers(element: Element | None, attribute: str) -> tuple[float, float, float]:
    text = "" if element is None else element.get(attribute, "")
    x, y, z = (float(each) for each in (text.split() if text else (0, 0, 0)))
    return x, y, z


def _span(pose: Pose3, shape: Element) -> tuple[float, float]:
    """The heights between which a shape at ``pose`` lies, m."""
    height = pose.position[2]
    up = [axis[2] for axis in rotated_axes(pose.orientation)]
    match shape.tag:
        case "box":
            reach = sum(abs(size * part) / 2 for size, part in zip(_numbers(shape, "size"), up, strict=True))
        case "sphere":
            reach = float(shape.get("radius", "0"))
        case "cylinder":
            radius, length = float(shape.get("radius", "0")), float(shape.get("length", "0"))
            reach = abs(up[2]) * length / 2 + radius * math.hypot(up[0], up[1])
        case _:
            return height, math.inf
    return height - reach, height + reach
