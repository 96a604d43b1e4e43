"""The two driven wheels of a base as its URDF has them: where they stand and how large they are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from models.frames import Joint, joints_in, offset_in


class NoWheels(ValueError):
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
    joints = joints_in(urdf)
    one, other = _find(joints, left), _find(joints, right)
    at_left, at_right = offset_in(joints, one.child), offset_in(joints, other.child)
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
