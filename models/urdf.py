"""The URDF of a robot of this folder: its joints and their frames, their limits, and the wheels of its base."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

from messages.errors import BadInput
from messages.se3 import Pose3, Rotation, Vector, quaternion_from_rpy, quaternion_multiply, rotate
from models import urdf_path


@dataclass(frozen=True)
class Joint:
    """A joint of a URDF: ``xyz`` [m] and ``rpy`` [rad] place the child in the parent at angle zero."""

    name: str
    kind: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector
    axis: Vector

    def rotation(self, angle: float = 0.0) -> Rotation:
        """Quaternion (x, y, z, w) from the parent to the child with the joint turned by ``angle`` [rad].

        URDF's fixed axes: q = q_z(yaw) q_y(pitch) q_x(roll), followed by the turn about the joint's axis.
        """
        mount = quaternion_from_rpy(*self.rpy)
        if not angle:
            return mount
        c, s = math.cos(angle / 2), math.sin(angle / 2)
        i, j, k = (s * each for each in self.axis)
        return quaternion_multiply(mount, (i, j, k, c))

    def transform(self, position: float = 0.0) -> Pose3:
        """The pose of the child in the parent, the joint at ``position`` [rad; m if it slides]."""
        if self.kind != "prismatic" or not position:
            return Pose3(self.xyz, self.rotation(0.0 if self.kind == "prismatic" else position))
        mount = self.rotation()
        x, y, z = rotate(mount, self.axis)
        return Pose3((self.xyz[0] + position * x, self.xyz[1] + position * y, self.xyz[2] + position * z), mount)


@cache
def read_joints(name: str) -> tuple[Joint, ...]:
    """All joints of the robot ``name`` in the URDF's order; raises ``models.UnknownModel``."""
    return parse_joints(urdf_path(name))


def parse_joints(urdf: Path) -> tuple[Joint, ...]:
    """All joints of a URDF, in its order."""
    return tuple(_joint(each) for each in ElementTree.parse(urdf).getroot().findall("joint"))


def link_offset(name: str, link: str) -> Vector:
    """Where the origin of ``link`` lies in the root frame of the robot ``name`` with all joints at zero, m."""
    return link_offset_in(read_joints(name), link)


def link_offset_in(joints: tuple[Joint, ...], link: str) -> Vector:
    """Where the origin of ``link`` lies in the root frame of the joints' tree with all of them at zero, m."""
    above = {joint.child: joint for joint in joints}
    offset = (0.0, 0.0, 0.0)
    while (joint := above.get(link)) is not None:
        x, y, z = rotate(joint.rotation(), offset)
        offset = (x + joint.xyz[0], y + joint.xyz[1], z + joint.xyz[2])
        link = joint.parent
    return offset


def _joint(element: ElementTree.Element) -> Joint:
    return Joint(
        name=element.attrib["name"],
        kind=element.attrib["type"],
        parent=_attribute(element, "parent", "link", ""),
        child=_attribute(element, "child", "link", ""),
        xyz=_vector(_attribute(element, "origin", "xyz", "0 0 0")),
        rpy=_vector(_attribute(element, "origin", "rpy", "0 0 0")),
        axis=_vector(_attribute(element, "axis", "xyz", "1 0 0")),
    )


def _attribute(element: ElementTree.Element, child: str, name: str, default: str) -> str:
    found = element.find(child)
    return default if found is None else found.attrib.get(name, default)


def _vector(text: str) -> Vector:
    x, y, z = (float(part) for part in text.split())
    return x, y, z


@dataclass(frozen=True)
class JointLimits:
    """A movable joint. rad or m, N m or N, rad/s or m/s; None where the URDF states no limit.

    ``velocity`` may be 0, which Gazebo takes for a limit and most URDFs mean as "unknown".
    """

    kind: str
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0


@cache
def read_joint_limits(name: str) -> dict[str, JointLimits]:
    """The movable joints of the robot ``name`` by their names, in the URDF's order; raises ``models.UnknownModel``."""
    joints = ElementTree.parse(urdf_path(name)).getroot().findall("joint")
    return {each.attrib["name"]: _limits(each) for each in joints if each.attrib["type"] != "fixed"}


def _limits(joint: ElementTree.Element) -> JointLimits:
    kind, limit, dynamics = joint.attrib["type"], joint.find("limit"), joint.find("dynamics")
    given = {} if limit is None else limit.attrib
    dynamics_attributes = {} if dynamics is None else dynamics.attrib
    ends = kind in ("revolute", "prismatic")
    return JointLimits(
        kind=kind,
        lower=float(given.get("lower", 0.0)) if ends else None,
        upper=float(given.get("upper", 0.0)) if ends else None,
        effort=_number(given, "effort"),
        velocity=_number(given, "velocity"),
        damping=float(dynamics_attributes.get("damping", 0.0)),
        friction=float(dynamics_attributes.get("friction", 0.0)),
    )


def _number(table: dict[str, str], name: str) -> float | None:
    return float(table[name]) if name in table else None


class NoWheels(BadInput):
    """A URDF does not tell what is asked of its wheels; the text says what it has instead."""


@dataclass(frozen=True)
class WheelPair:
    """Distance of the joints' origins [m]; radii [m] of the wheels, None where no collision shape tells; how far left
    of the root's x axis the wheels stand [m]."""

    separation: float
    left_radius: float | None
    right_radius: float | None
    left_offset: float
    right_offset: float


def read_wheels(urdf: Path, left: str, right: str) -> WheelPair:
    """The wheels behind the joints ``left`` and ``right``; raises NoWheels for a joint that there is not.

    As ROS's ``diff_drive_controller`` reads them: the separation is the Euclidean distance between the joints' origins,
    the radius that of the wheel link's collision sphere or cylinder.
    """
    root = ElementTree.parse(urdf).getroot()
    joints = parse_joints(urdf)
    one, other = _find(joints, left), _find(joints, right)
    at_left, at_right = link_offset_in(joints, one.child), link_offset_in(joints, other.child)
    return WheelPair(
        separation=math.dist(at_left, at_right),
        left_radius=_radius(root, one.child),
        right_radius=_radius(root, other.child),
        left_offset=at_left[1],
        right_offset=at_right[1],
    )


def _find(joints: tuple[Joint, ...], name: str) -> Joint:
    for joint in joints:
        if joint.name == name:
            return joint
    movable = ", ".join(joint.name for joint in joints if joint.kind != "fixed")
    raise NoWheels(f"there is no wheel joint {name!r} (movable: {movable or 'none'})")


def _radius(root: ElementTree.Element, link: str) -> float | None:
    for kind in ("sphere", "cylinder"):
        shape = root.find(f"link[@name='{link}']/collision/geometry/{kind}")
        if shape is not None:
            return float(shape.attrib["radius"])
    return None
