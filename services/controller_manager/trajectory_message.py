"""Converts a ``JointTrajectory`` to segments: validated, joints in the controller's order, past points dropped."""

from __future__ import annotations

import math
from collections.abc import Collection

from messages.control import TrajectoryError
from messages.trajectory import JointTrajectory, JointTrajectoryPoint
from services.controller_manager.config import TrajectoryConfig
from services.controller_manager.trajectory import JointPoint, Sampled, Segment, Trajectory, Values, segment
from services.runtime.errors import BadInput, did_you_mean

MAX_POINTS = 10_000
MAX_DURATION_NS = 86_400_000_000_000
"""Maximum time ahead of a trajectory's start, and maximum duration: one day."""


class BadTrajectory(BadInput):
    """A trajectory cannot be followed; ``code`` is the error code in the result of its goal."""

    def __init__(self, code: TrajectoryError, text: str) -> None:
        super().__init__(text)
        self.code = code


def plan(
    message: JointTrajectory,
    joints: tuple[str, ...],
    continuous: Collection[str],
    config: TrajectoryConfig,
    current: Trajectory,
    now: int,
    goal: str = "",
) -> Trajectory:
    """Return the trajectory to follow from ``now`` [ns] on: ``current`` until the start of the message's, then that.

    As in ROS's JointTrajectoryController, past points are dropped, the segment to the first remaining point begins at
    the desired state at that time, unnamed joints hold their position (if partial goals are allowed), and continuous
    joints turn the shorter way to the first point.

    Args:
        message: The trajectory; a stamp of 0 means ``now``.
        joints: The controller's joints.
        continuous: Those of them that are continuous.
        config: The controller's settings.
        current: The trajectory followed at present.
        now: The time [ns].
        goal: The ID of the goal, empty for none.

    Raises:
        BadTrajectory: It cannot be followed; the text has the reason.
    """
    order = _order(message, joints, config.allow_partial_joints_goal)
    _check_points(message, config)
    stamp = message.header.stamp.ns
    begin = now if stamp == 0 else stamp
    if begin - now > MAX_DURATION_NS:
        raise BadTrajectory(
            TrajectoryError.INVALID_GOAL, f"it begins {(begin - now) / 1e9:.0f} s ahead, more than a day"
        )
    points = [(begin + each.time_from_start.ns, each) for each in message.points]
    ahead = [entry for entry in points if entry[0] > now or (entry[0] == now and stamp == 0)]
    if not ahead:
        late = (now - points[-1][0]) / 1e9
        raise BadTrajectory(
            TrajectoryError.OLD_HEADER_TIMESTAMP,
            f"all its points are in the past: the last was due {late:.3f} s ago. Is the stamp that of another clock? "
            "A stamp of 0 begins at once",
        )
    start = max(begin, now)
    desired = current.at(start)
    offsets = _wrap(ahead[0][1], order, joints, continuous, desired)
    segments: list[Segment] = []
    at, before = start, JointPoint(*desired)
    for time, each in ahead:
        point = _point(each, order, desired, offsets)
        segments.append(segment(at, time, before, point, goal, config.splines))
        at, before = time, point
    kept = current.until(now, start) if start > now else ()
    if len(kept) > MAX_POINTS:
        raise BadTrajectory(TrajectoryError.INVALID_GOAL, f"more than {MAX_POINTS} points are still to come before it")
    return Trajectory((*kept, *segments))


def _order(message: JointTrajectory, joints: tuple[str, ...], partial: bool) -> list[int | None]:
    """Return the index in the message of each of the controller's joints; None if it is missing."""
    names = message.joint_names
    code = TrajectoryError.INVALID_JOINTS
    if not names:
        raise BadTrajectory(code, f"it names no joints (the controller's: {', '.join(joints)})")
    for index, name in enumerate(names):
        if name not in joints:
            near = did_you_mean(name, joints)
            raise BadTrajectory(code, f"unknown joint {name!r}{near} (the controller's: {', '.join(joints)})")
        if name in names[:index]:
            raise BadTrajectory(code, f"it names the joint {name!r} twice")
    missing = [each for each in joints if each not in names]
    if missing and not partial:
        raise BadTrajectory(
            code, f"the joints {', '.join(missing)} are missing, and allow_partial_joints_goal is not set"
        )
    return [names.index(each) if each in names else None for each in joints]


def _check_points(message: JointTrajectory, config: TrajectoryConfig) -> None:
    code, count = TrajectoryError.INVALID_GOAL, len(message.joint_names)
    if not message.points:
        raise BadTrajectory(code, "it has no points")
    if len(message.points) > MAX_POINTS:
        raise BadTrajectory(code, f"it has {len(message.points)} points, the limit is {MAX_POINTS}")
    before = -1
    for index, point in enumerate(message.points):
        if len(point.positions) != count:
            raise BadTrajectory(code, f"point {index} has {len(point.positions)} positions of {count} joints")
        for what in ("velocities", "accelerations"):
            if (given := len(getattr(point, what))) not in (0, count):
                raise BadTrajectory(code, f"point {index} has {given} {what} of {count} joints: all, or none")
        time = point.time_from_start.ns
        if time < 0 or time > MAX_DURATION_NS:
            raise BadTrajectory(code, f"point {index} has time_from_start = {time / 1e9:g} s, not from 0 to a day")
        if time <= before:
            raise BadTrajectory(
                code, f"point {index} has time_from_start = {time / 1e9:g} s, not later than the point before it"
            )
        before = time
    last = message.points[-1]
    if not config.allow_nonzero_velocity_at_trajectory_end and any(last.velocities):
        raise BadTrajectory(code, "its last point moves, and allow_nonzero_velocity_at_trajectory_end is false")


def _wrap(
    first: JointTrajectoryPoint,
    order: list[int | None],
    joints: tuple[str, ...],
    continuous: Collection[str],
    desired: Sampled,
) -> Values:
    """Return the offset [rad] of each joint's positions with which it turns at most half a turn to the first point."""
    offsets = []
    for joint, place, position in zip(joints, order, desired.positions, strict=True):
        turns = 0
        if place is not None and joint in continuous:
            turns = round((position - first.positions[place]) / math.tau)
        offsets.append(turns * math.tau)
    return tuple(offsets)


def _point(point: JointTrajectoryPoint, order: list[int | None], desired: Sampled, offsets: Values) -> JointPoint:
    """Return a point in the order of the controller's joints; unnamed joints stay at their desired positions."""
    positions = tuple(
        desired.positions[joint] if place is None else point.positions[place] + offsets[joint]
        for joint, place in enumerate(order)
    )

    def part(values: Values) -> Values | None:
        return tuple(0.0 if place is None else values[place] for place in order) if values else None

    return JointPoint(positions, part(point.velocities), part(point.accelerations))
