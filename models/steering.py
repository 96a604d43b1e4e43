"""The steering of a car-like or tricycle-like robot, inferred from its joints and shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from messages.se3 import Vector, rotate
from models.dynamics import GRAVITY
from models.model import SteeredWheel, SteeringConfig
from models.shapes import LinkShapes
from models.urdf import Joint, RobotDescription
from models.urdf_writer import link_poses
from models.wheels import Wheel, is_continuous, read_wheel, rolling_joints

TRAIL = 0.2
"""Maximum trail of a steered wheel, in wheel radii; the wheel of a caster is farther behind its swivel axis."""
PAIRED = 0.02
"""Maximum deviation [m] of the two wheels of an axle from mirror symmetry."""
MAX_STEER = 0.6
"""Maximum steering angle [rad] of a joint without limits."""
FARTHEST_STEER = 1.3
"""Maximum steering angle [rad] of any joint."""
RATE = 1.5
"""Maximum steering rate [rad/s], unless a joint has a lower velocity limit."""
SHORTEST_WHEELBASE = 0.01
"""Minimum wheelbase [m]; steered wheels beside the driven ones do not steer."""


class Steered(NamedTuple):
    """A steered wheel and its steering joint; ``up`` is the vertical component of that joint's axis."""

    wheel: Wheel
    steering: Joint
    up: float


class SteeredBase(NamedTuple):
    """A base with one axle that is not steered: the wheels of that axle, and the steered ones."""

    left: Wheel
    right: Wheel
    steered: tuple[Steered, ...]


def find_steering(
    robot: RobotDescription, shapes: Mapping[str, LinkShapes], commanded: set[str], ground: float
) -> SteeredBase | None:
    """Find the steered wheels of a robot, and the one pair that is not steered; None if there are none.

    Args:
        robot: The robot.
        shapes: The shapes of its links.
        commanded: Commanded joints: any other swivel joint belongs to a caster, unless it has limits.
        ground: Height [m] that the lowest point of a wheel may not exceed if it is to touch the ground.
    """
    steered, others = [], []
    for joint in rolling_joints(robot):
        wheel = read_wheel(robot, shapes, joint)
        if not wheel.radius > 0 or abs(wheel.direction[1]) < 0.9 or wheel.place[2] - wheel.radius > ground:
            continue
        swivels = list(_swivels(robot, joint))
        if not swivels:
            others.append(wheel)
        for swivel, place, up in swivels[:1]:
            trail = abs(wheel.place[0] - place[0])
            if trail <= TRAIL * wheel.radius and (swivel.name in commanded or not is_continuous(swivel)):
                steered.append(Steered(wheel, swivel, up))
    left, right = ([each for each in others if each.place[1] * side > 0] for side in (1, -1))
    if not steered or len(left) != 1 or len(right) != 1:
        return None
    one, other = left[0], right[0]
    if abs(one.place[0] - other.place[0]) + abs(one.place[1] + other.place[1]) > PAIRED:
        return None
    axle = (one.place[0] + other.place[0]) / 2
    if any(abs(each.wheel.place[0] - axle) < SHORTEST_WHEELBASE for each in steered):
        return None
    return SteeredBase(one, other, tuple(steered))


def steering_config(base: SteeredBase, stated: float | None, mass: float) -> SteeringConfig:
    """Return the steering; ``stated`` is the maximum angle [rad] from a tag, if any, ``mass`` the robot's [kg]."""
    axle = (base.left.place[0] + base.right.place[0]) / 2
    curvatures, rates, torques = [], [RATE], []
    for each in base.steered:
        x, y, _ = each.wheel.place
        limits = each.steering.limits
        bounds = [abs(end) for end in (limits.lower, limits.upper) if end is not None]
        least = min(bounds, default=0.0) if not is_continuous(each.steering) else 0.0
        tangent = math.tan(min(least or MAX_STEER, stated or FARTHEST_STEER, FARTHEST_STEER))
        # The inner wheel of a curve turns farthest: tan(a) = k x / (1 - k |y|).
        curvatures.append(tangent / (abs(x - axle) + abs(y) * tangent))
        rates += [limits.velocity] if limits.velocity else []
        torques += [limits.effort] if limits.effort else []
    return SteeringConfig(
        wheels=tuple(
            SteeredWheel(
                joint=each.steering.name,
                ahead=round(each.wheel.place[0] - axle, 6),
                left=round(each.wheel.place[1], 6),
                reversed=each.up < 0,
            )
            for each in base.steered
        ),
        max_curvature=0.99 * min(curvatures),
        torque=min(torques, default=0.0) or max(0.1, mass * GRAVITY * base.left.radius),
        rate=min(rates),
    )


def _swivels(robot: RobotDescription, wheel: Joint) -> Iterator[tuple[Joint, Vector, float]]:
    """Yield the joints with vertical axes between a wheel and the root, from the wheel up: with the position of their
    axes in the root's frame, and the vertical component of these."""
    above, poses = {each.child: each for each in robot.joints}, link_poses(robot)
    joint = above.get(wheel.parent)
    while joint is not None:
        pose = poses[joint.child]
        up = rotate(pose.orientation, joint.axis)[2]
        if joint.kind in ("revolute", "continuous") and abs(up) > 0.9:
            yield joint, pose.position, up
        joint = above.get(joint.parent)
