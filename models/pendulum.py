"""What it takes to hold and to turn a joint, from the masses of a URDF: a pendulum, whatever hangs on it."""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree import ElementTree

from models import model_path
from models.frames import Joint, Vector, joints_in, rotated

GRAVITY = 9.81
"""m/s2, downward, as in the simulation."""

Rotation = tuple[float, float, float, float]


class Mass(NamedTuple):
    """A link: kg, the frame of its inertia in its own, and xx, yy, zz, xy, xz, yz of its tensor there, kg m2."""

    mass: float
    frame: Joint
    tensor: tuple[float, ...]

    def about(self, axis: Vector) -> float:
        """Its own inertia [kg m2] about an axis through its centre, of length 1, in the link's frame."""
        x, y, z = rotated(_back(self.frame.rotation()), axis)
        xx, yy, zz, xy, xz, yz = self.tensor
        return xx * x * x + yy * y * y + zz * z * z + 2 * (xy * x * y + xz * x * z + yz * y * z)


class Pendulum(NamedTuple):
    """At the angle q [rad] the holding torque is ``torque`` sin(q - ``rest``), N m and rad.

    ``inertia`` [kg m2] is the one about the joint.
    """

    torque: float
    rest: float
    inertia: float


def pendulum(name: str, joint: str) -> Pendulum:
    """The pendulum on a joint of the upright robot ``name``, all joints beyond at zero.

    Raises ``models.UnknownModel``, and KeyError when the robot has no such joint.
    """
    urdf = model_path(name)
    joints = joints_in(urdf)
    at = {each.name: each for each in joints}[joint]
    masses = {link.attrib["name"]: _mass(link) for link in ElementTree.parse(urdf).getroot().findall("link")}
    down = _into(at, joints, (0.0, 0.0, -GRAVITY))
    level = upright = inertia = 0.0
    for mass, place, own in _beyond(at.child, joints, masses, at.axis):
        across = _cross(at.axis, place)
        level += mass * _along(at.axis, place, down)
        upright += mass * _along(at.axis, across, down)
        inertia += mass * sum(each * each for each in across) + own
    return Pendulum(math.hypot(level, upright), math.atan2(level, -upright), inertia)


def _mass(link: ElementTree.Element) -> Mass:
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if inertial is None or mass is None:
        return Mass(0.0, _frame(None), (0.0,) * 6)
    tensor = inertial.find("inertia")
    given = {} if tensor is None else tensor.attrib
    moments = tuple(float(given.get(name, 0.0)) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    return Mass(float(mass.attrib["value"]), _frame(inertial.find("origin")), moments)


def _frame(origin: ElementTree.Element | None) -> Joint:
    """Where an inertia lies, as a fixed joint would place it."""
    given = {} if origin is None else origin.attrib
    (x, y, z), (roll, pitch, yaw) = (map(float, given.get(name, "0 0 0").split()) for name in ("xyz", "rpy"))
    return Joint("", "fixed", "", "", (x, y, z), (roll, pitch, yaw), (0.0, 0.0, 1.0))


def _beyond(
    link: str, joints: tuple[Joint, ...], masses: dict[str, Mass], axis: Vector
) -> list[tuple[float, Vector, float]]:
    """Of ``link`` and all that hang on it: masses [kg], their places [m] in its frame, and their own inertia [kg m2]
    about ``axis``, a direction in its frame."""
    own = masses[link]
    found = [(own.mass, own.frame.xyz, own.about(axis))]
    for joint in joints:
        if joint.parent == link:
            turn = joint.rotation()
            for mass, place, moment in _beyond(joint.child, joints, masses, rotated(_back(turn), axis)):
                x, y, z = rotated(turn, place)
                found.append((mass, (x + joint.xyz[0], y + joint.xyz[1], z + joint.xyz[2]), moment))
    return found


def _into(joint: Joint, joints: tuple[Joint, ...], vector: Vector) -> Vector:
    """A vector of the root frame in the frame of a joint."""
    above = {each.child: each for each in joints}
    chain = [joint]
    while (upper := above.get(chain[-1].parent)) is not None:
        chain.append(upper)
    for each in reversed(chain):
        vector = rotated(_back(each.rotation()), vector)
    return vector


def _back(turn: Rotation) -> Rotation:
    x, y, z, w = turn
    return -x, -y, -z, w


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _along(axis: Vector, place: Vector, force: Vector) -> float:
    """The torque of a force at a place about an axis."""
    return sum(a * b for a, b in zip(axis, _cross(place, force), strict=True))
