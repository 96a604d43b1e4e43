"""How far joints may be off a trajectory, and off its end: the controller's terms, and those of a goal over them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from messages.control import FollowJointTrajectoryGoal, JointTolerance
from services.controller_manager.config import TrajectoryConfig
from services.runtime.errors import unknown_name


@dataclass(frozen=True)
class JointLimit:
    """How far one joint may be off in position [rad or m] and velocity [rad/s or m/s]; 0 for no limit."""

    position: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True)
class Tolerances:
    """By joints: ``path`` holds on the way, ``goal`` at the end, which must be reached ``goal_time`` [s] after it was
    due; None waits for it without limit."""

    path: Mapping[str, JointLimit] = field(default_factory=dict)
    goal: Mapping[str, JointLimit] = field(default_factory=dict)
    goal_time: float | None = 0.0


def default_tolerances(joints: Iterable[str], config: TrajectoryConfig) -> Tolerances:
    """The terms of a controller."""
    path, goal = {}, {}
    for joint in joints:
        if (stated := config.constraints.get(joint)) is not None and stated.trajectory:
            path[joint] = JointLimit(stated.trajectory)
        goal[joint] = JointLimit(stated.goal if stated is not None else 0.0, config.stopped_velocity_tolerance)
    unlimited = config.waits_for_goal and not config.goal_time
    return Tolerances(path, goal, None if unlimited else config.goal_time)


def goal_tolerances(goal: FollowJointTrajectoryGoal, own: Tolerances, joints: tuple[str, ...]) -> Tolerances:
    """The terms of a goal: what it states wins; 0 leaves the controller's, a negative value is no limit.

    Raises BadInput for a joint that the controller does not have.
    """
    time = goal.goal_time_tolerance.ns / 1e9
    goal_time = own.goal_time if time == 0 else None if time < 0 else time
    return Tolerances(
        _replaced(own.path, goal.path_tolerance, joints), _replaced(own.goal, goal.goal_tolerance, joints), goal_time
    )


def violation(
    limits: Mapping[str, JointLimit], joints: tuple[str, ...], errors: Iterable[float], rates: Iterable[float]
) -> str:
    """What exceeds the limits, in a few words; empty if nothing does."""
    for joint, error, rate in zip(joints, errors, rates, strict=True):
        limit = limits.get(joint)
        if limit is None:
            continue
        if limit.position and abs(error) > limit.position:
            return f"{joint} is {abs(error):.4g} off, {limit.position:g} is the most"
        if limit.velocity and abs(rate) > limit.velocity:
            return f"the velocity of {joint} is {abs(rate):.4g} off, {limit.velocity:g} is the most"
    return ""


def _replaced(
    own: Mapping[str, JointLimit], stated: Iterable[JointTolerance], joints: tuple[str, ...]
) -> dict[str, JointLimit]:
    limits = dict(own)
    for each in stated:
        if each.name not in joints:
            raise unknown_name("joint", each.name, joints, "tolerance")
        limit = limits.get(each.name, JointLimit())
        if each.position:
            limit = replace(limit, position=max(0.0, each.position))
        if each.velocity:
            limit = replace(limit, velocity=max(0.0, each.velocity))
        limits[each.name] = limit
    return limits
