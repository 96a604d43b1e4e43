"""Closed-form predictions from a robot's parameters: the pendulum on a joint, and the stopping distance of a base."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.se3 import Vector, cross, rotate, rotate_inverse
from models.urdf import Inertia, Joint, read_robot

GRAVITY = 9.81
"""Gravity [m/s2], downward, as in the simulation."""


class Pendulum(NamedTuple):
    """A pendulum: at the angle q [rad], the holding torque [N m] is ``torque`` sin(q - ``rest``).

    ``inertia`` [kg m2] is about the joint.
    """

    torque: float
    rest: float
    inertia: float


def read_pendulum(name: str, joint: str) -> Pendulum:
    """Return the pendulum on a joint of the upright robot ``name``, with all joints beyond it at zero.

    Raises ``models.UnknownModel``, and KeyError if the robot has no such joint.
    """
    robot = read_robot(name)
    joints = robot.joints
    at = {each.name: each for each in joints}[joint]
    masses = {link.name: link.inertia for link in robot.links}
    down = _to_joint_frame(at, joints, (0.0, 0.0, -GRAVITY))
    level = upright = inertia = 0.0
    for mass, place, own in _subtree_masses(at.child, joints, masses, at.axis):
        across = cross(at.axis, place)
        level += mass * _torque_about(at.axis, place, down)
        upright += mass * _torque_about(at.axis, across, down)
        inertia += mass * sum(each * each for each in across) + own
    return Pendulum(math.hypot(level, upright), math.atan2(level, -upright), inertia)


def _moment_about(inertia: Inertia, axis: Vector) -> float:
    """Return a link's own inertia [kg m2] about a unit axis through its centre of mass, given in the link's frame."""
    x, y, z = rotate_inverse(inertia.centre.orientation, axis)
    xx, yy, zz, xy, xz, yz = inertia.tensor
    return xx * x * x + yy * y * y + zz * z * z + 2 * (xy * x * y + xz * x * z + yz * y * z)


def _subtree_masses(
    link: str, joints: tuple[Joint, ...], masses: dict[str, Inertia], axis: Vector
) -> list[tuple[float, Vector, float]]:
    """Return, for ``link`` and all links below it, masses [kg], centres of mass [m] in its frame, and inertias [kg m2]
    about ``axis``, a direction in its frame."""
    own = masses[link]
    found = [(own.mass, own.centre.position, _moment_about(own, axis))]
    for joint in joints:
        if joint.parent == link:
            turn = joint.rotation()
            for mass, place, moment in _subtree_masses(joint.child, joints, masses, rotate_inverse(turn, axis)):
                x, y, z = rotate(turn, place)
                found.append((mass, (x + joint.xyz[0], y + joint.xyz[1], z + joint.xyz[2]), moment))
    return found


def _to_joint_frame(joint: Joint, joints: tuple[Joint, ...], vector: Vector) -> Vector:
    """Transform a vector from the root frame to the frame of a joint."""
    above = {each.child: each for each in joints}
    chain = [joint]
    while (upper := above.get(chain[-1].parent)) is not None:
        chain.append(upper)
    for each in reversed(chain):
        vector = rotate_inverse(each.rotation(), vector)
    return vector


def _torque_about(axis: Vector, place: Vector, force: Vector) -> float:
    """Return the torque about an axis of a force at a point."""
    return sum(a * b for a, b in zip(axis, cross(place, force), strict=True))


class StopPrediction(NamedTuple):
    """Time [s] and distance [m] from the last command to standstill."""

    time: float
    distance: float


def predict_stop(speed: float, timeout: float, brake: float) -> StopPrediction:
    """Predict the stop of a base at ``speed`` [m/s], of either sign, when its commands cease.

    It keeps its speed for ``timeout`` [s] after the last command, then brakes at a constant ``brake`` > 0 [m/s2]: t =
    timeout + v / a, s = v timeout + v^2 / 2a. For an emergency stop, the time-out is 0. The distance is along the path
    and never negative.
    """
    if brake <= 0 or timeout < 0:
        raise ValueError(f"a stop needs a brake above 0 and a time-out of at least 0, got {brake} and {timeout}")
    v = abs(speed)
    return StopPrediction(timeout + v / brake, v * timeout + v * v / (2 * brake))
