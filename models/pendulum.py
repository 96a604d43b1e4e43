"""What it takes to hold a joint against gravity, from the masses of a URDF: a pendulum, whatever hangs on it."""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree import ElementTree

from models import model_path
from models.frames import Joint, Vector, joints_in, rotated

GRAVITY = 9.81
"""m/s2, downward, as in the simulation."""

Mass = tuple[float, Vector]
"""kg, and where it is, m."""


class Pendulum(NamedTuple):
    """At the angle q [rad] the holding torque is ``torque`` sin(q - ``rest``), N m and rad."""

    torque: float
    rest: float


def pendulum(name: str, joint: str) -> Pendulum:
    """The pendulum on a joint of the upright robot ``name``, all joints beyond at zero.

    Raises ``models.UnknownModel``, and KeyError when the robot has no such joint.
    """
    urdf = model_path(name)
    joints = joints_in(urdf)
    at = {each.name: each for each in joints}[joint]
    masses = {link.attrib["name"]: _mass(link) for link in ElementTree.parse(urdf).getroot().findall("link")}
    down = _into(at, joints, (0.0, 0.0, -GRAVITY))
    level = upright = 0.0
    for mass, place in _beyond(at.child, joints, masses):
        level += mass * _along(at.axis, place, down)
        upright += mass * _along(at.axis, _cross(at.axis, place), down)
    return Pendulum(math.hypot(level, upright), math.atan2(level, -upright))


def _mass(link: ElementTree.Element) -> Mass:
    inertial = link.find("inertial")
    mass, origin = (None, None) if inertial is None else (inertial.find("mass"), inertial.find("origin"))
    if mass is None:
        return 0.0, (0.0, 0.0, 0.0)
    x, y, z = (float(each) for each in ("0 0 0" if origin is None else origin.attrib.get("xyz", "0 0 0")).split())
    return float(mass.attrib["value"]), (x, y, z)


def _beyond(
    link: str, joints: tuple[Joint, ...], masses: dict[str, tuple[float, Vector]]
) -> list[tuple[float, Vector]]:
    """Masses [kg] and their places [m] in the frame of ``link``, its own and all that hang on it."""
    found = [masses[link]]
    for joint in joints:
        if joint.parent == link:
            for mass, place in _beyond(joint.child, joints, masses):
                x, y, z = rotated(joint.rotation(), place)
                found.append((mass, (x + joint.xyz[0], y + joint.xyz[1], z + joint.xyz[2])))
    return found


def _into(joint: Joint, joints: tuple[Joint, ...], vector: Vector) -> Vector:
    """A vector of the root frame in the frame of a joint."""
    above = {each.child: each for each in joints}
    chain = [joint]
    while (upper := above.get(chain[-1].parent)) is not None:
        chain.append(upper)
    for each in reversed(chain):
        x, y, z, w = each.rotation()
        vector = rotated((-x, -y, -z, w), vector)
    return vector


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _along(axis: Vector, place: Vector, force: Vector) -> float:
    """The torque of a force at a place about an axis."""
    return sum(a * b for a, b in zip(axis, _cross(place, force), strict=True))
