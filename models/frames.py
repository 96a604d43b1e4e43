"""The tree of frames of a robot, read from its URDF: what ``tf_static`` and ``tf`` need to know of the joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

from models import model_path

Vector = tuple[float, float, float]


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

    def rotation(self, angle: float = 0.0) -> tuple[float, float, float, float]:
        """Quaternion (x, y, z, w) from the parent to the child with the joint turned by ``angle`` [rad].

        URDF's fixed axes: q = q_z(yaw) q_y(pitch) q_x(roll), followed by the turn about the joint's axis.
        """
        roll, pitch, yaw = (each / 2 for each in self.rpy)
        cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
        x, y, z, w = (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )
        if not angle:
            return x, y, z, w
        c, s = math.cos(angle / 2), math.sin(angle / 2)
        i, j, k = (s * each for each in self.axis)
        return (
            w * i + x * c + y * k - z * j,
            w * j - x * k + y * c + z * i,
            w * k + x * j - y * i + z * c,
            w * c - x * i - y * j - z * k,
        )

    def placement(self, position: float = 0.0) -> tuple[Vector, tuple[float, float, float, float]]:
        """Where the child lies in the parent, m and quaternion, the joint at ``position`` [rad; m if it slides]."""
        if self.kind != "prismatic" or not position:
            return self.xyz, self.rotation(0.0 if self.kind == "prismatic" else position)
        turn = self.rotation()
        x, y, z = rotated(turn, self.axis)
        return (self.xyz[0] + position * x, self.xyz[1] + position * y, self.xyz[2] + position * z), turn


@cache
def read_joints(name: str) -> tuple[Joint, ...]:
    """All joints of the robot ``name`` in the URDF's order; raises ``models.UnknownModel``."""
    return joints_in(model_path(name))


def joints_in(urdf: Path) -> tuple[Joint, ...]:
    """All joints of a URDF, in its order."""
    return tuple(_joint(each) for each in ElementTree.parse(urdf).getroot().findall("joint"))


def link_offset(name: str, link: str) -> Vector:
    """Where the origin of ``link`` lies in the root frame of the robot ``name`` with all joints at zero, m."""
    return offset_in(read_joints(name), link)


def offset_in(joints: tuple[Joint, ...], link: str) -> Vector:
    """Where the origin of ``link`` lies in the root frame of the joints' tree with all of them at zero, m."""
    above = {joint.child: joint for joint in joints}
    offset = (0.0, 0.0, 0.0)
    while (joint := above.get(link)) is not None:
        x, y, z = rotated(joint.rotation(), offset)
        offset = (x + joint.xyz[0], y + joint.xyz[1], z + joint.xyz[2])
        link = joint.parent
    return offset


def rotated(rotation: tuple[float, float, float, float], vector: Vector) -> Vector:
    """A vector turned by a rotation, a quaternion (x, y, z, w)."""
    x, y, z, w = rotation
    a, b, c = vector
    i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return a + 2 * (y * k - z * j), b + 2 * (z * i - x * k), c + 2 * (x * j - y * i)


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
