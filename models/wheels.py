"""The wheels of a robot, from its joints and shapes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from messages.se3 import Pose3, Vector, cross, rotate, rotate_inverse
from models.extents import support
from models.shapes import LinkShapes, Shape
from models.urdf import Joint, RobotDescription
from models.urdf_writer import link_poses

TOUCHES = 0.01
"""Height [m] above a robot's lowest point up to which a part can touch the ground."""
ENDLESS = 1000.0
"""Range [rad] above which a revolute joint counts as continuous."""

ROLL_DIRECTIONS = 24
"""Number of directions around its axle in which a wheel is measured."""


@dataclass(frozen=True)
class Wheel:
    """A wheel: its joint, the link with its shapes, the centre of its axle in that link's frame (``centre``) and in the
    root's (``place``) [m], the axle's unit vector in both (``axle``, ``direction``), radius and width [m], 0 without
    shapes."""

    joint: str
    link: str
    centre: Vector
    place: Vector
    axle: Vector
    direction: Vector
    radius: float
    width: float


def read_wheel(robot: RobotDescription, shapes: Mapping[str, LinkShapes], joint: Joint) -> Wheel:
    """Return the wheel on a joint, from its shapes: those of the child, or of the link fixed to it that extends
    farthest from the axle, e.g. a tyre on a hub. Collision shapes take precedence over visuals."""
    held = {joint.child: Pose3()}
    pending = [joint.child]
    for link in pending:
        for each in robot.joints:
            if each.parent == link and not each.single_dof:
                held[each.child] = held[link] @ each.transform()
                pending.append(each.child)
    solid = [link for link in held if link in shapes and shapes[link].collisions]
    wheels = [_wheel_of(robot, shapes, joint, link, held[link]) for link in solid or held]
    return max(wheels, key=lambda each: each.radius)


def _wheel_of(robot: RobotDescription, shapes: Mapping[str, LinkShapes], joint: Joint, link: str, held: Pose3) -> Wheel:
    """Return the wheel with the shapes of ``link``; ``held`` is its pose in the frame of the joint's child."""
    solid = shapes.get(link, LinkShapes()).any
    flat = _across(joint.axis)
    reach = [_reach(solid, held, _combine(flat, math.tau * each / ROLL_DIRECTIONS)) for each in range(ROLL_DIRECTIONS)]
    out, back = _reach(solid, held, joint.axis), -_reach(solid, held, _scaled(joint.axis, -1.0))
    spheres = [each for each in solid if each.kind == "sphere"]
    centre = Pose3(_scaled(joint.axis, (out + back) / 2 if solid else 0.0))
    pose = link_poses(robot)[joint.child]
    return Wheel(
        joint=joint.name,
        link=link,
        centre=(held.inverse() @ centre).position,
        place=(pose @ centre).position,
        axle=rotate_inverse(held.orientation, joint.axis),
        direction=rotate(pose.orientation, joint.axis),
        radius=round(max(reach), 6) if solid else 0.0,  # angles in URDFs have few digits
        width=0.0 if len(spheres) == len(solid) else out - back,
    )


def is_continuous(joint: Joint) -> bool:
    """Whether a joint is continuous, or revolute with a range above ENDLESS."""
    low, high = joint.limits.lower, joint.limits.upper
    endless = low is not None and high is not None and high - low > ENDLESS
    return joint.kind == "continuous" or (joint.kind == "revolute" and endless)


def rolling_joints(robot: RobotDescription) -> list[Joint]:
    """Return the continuous joints with a horizontal axis, on which wheels turn, driven or not."""
    poses = link_poses(robot)
    return [
        joint
        for joint in robot.joints
        if is_continuous(joint) and abs(rotate(poses[joint.child].orientation, joint.axis)[2]) < 0.1
    ]


def _reach(shapes: Iterable[Shape], frame: Pose3, direction: Vector) -> float:
    return max((support(each, frame, direction) for each in shapes), default=0.0)


def _across(axis: Vector) -> tuple[Vector, Vector]:
    """Return two unit vectors perpendicular to a unit vector and to each other."""
    least = min(range(3), key=lambda each: abs(axis[each]))
    other = [0.0, 0.0, 0.0]
    other[least] = 1.0
    one = cross(axis, (other[0], other[1], other[2]))
    length = math.sqrt(sum(each * each for each in one))
    one = _scaled(one, 1 / length)
    return one, cross(axis, one)


def _combine(plane: tuple[Vector, Vector], angle: float) -> Vector:
    (a, b, c), (d, e, f) = plane
    cos, sin = math.cos(angle), math.sin(angle)
    return a * cos + d * sin, b * cos + e * sin, c * cos + f * sin


def _scaled(vector: Vector, factor: float) -> Vector:
    return vector[0] * factor, vector[1] * factor, vector[2] * factor
