"""Trajectories of joints: splines between points, as in ROS's joint_trajectory_controller, and their tolerances."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from messages.control import FollowJointTrajectoryGoal, JointTolerance
from services.controller_manager.config import TrajectoryConfig
from services.runtime.errors import unknown_name

Values = tuple[float, ...]
Coefficients = tuple[float, float, float, float, float, float]


class JointPoint(NamedTuple):
    """Positions [rad or m] of joints, velocities [rad/s or m/s], accelerations [rad/s2 or m/s2]; None: unspecified."""

    positions: Values
    velocities: Values | None = None
    accelerations: Values | None = None


class Sampled(NamedTuple):
    """Desired positions, velocities and accelerations of joints."""

    positions: Values
    velocities: Values
    accelerations: Values


@dataclass(frozen=True)
class Segment:
    """The polynomials of all joints from ``start`` to ``end`` [ns]: c0 + c1 t + … + c5 t^5, t in s from the start.

    ``goal`` is the ID of the goal that it belongs to, empty for none.
    """

    start: int
    end: int
    coefficients: tuple[Coefficients, ...]
    final: Values
    goal: str = ""

    def at(self, now: int) -> Sampled:
        """Sample the joints at ``now`` [ns]: before the start as at the start, from the end on at rest at the end."""
        if now >= self.end:
            zeros = (0.0,) * len(self.final)
            return Sampled(self.final, zeros, zeros)
        t = max(0, now - self.start) / 1e9
        rows = [_polynomial(each, t) for each in self.coefficients]
        return Sampled(tuple(row[0] for row in rows), tuple(row[1] for row in rows), tuple(row[2] for row in rows))


@dataclass(frozen=True)
class Trajectory:
    """Segments in order of their start times; each is valid until the next one starts."""

    segments: tuple[Segment, ...]

    def segment(self, now: int) -> Segment:
        """Return the segment at ``now`` [ns]: the last that has started, else the first."""
        return self.segments[max(0, bisect_right(self.segments, now, key=lambda each: each.start) - 1)]

    def at(self, now: int) -> Sampled:
        """Sample the joints at ``now`` [ns]."""
        return self.segment(now).at(now)

    @property
    def end(self) -> int:
        """The end of the last segment, ns."""
        return self.segments[-1].end

    def until(self, now: int, start: int) -> tuple[Segment, ...]:
        """Return the segments that are valid at ``now`` or later and start before ``start`` [ns]."""
        first = self.segments.index(self.segment(now))
        return tuple(each for each in self.segments[first:] if each.start < start)


def hold(positions: Values, now: int, goal: str = "") -> Trajectory:
    """Return the trajectory that stays at ``positions`` from ``now`` [ns] on."""
    rows = tuple((each, 0.0, 0.0, 0.0, 0.0, 0.0) for each in positions)
    return Trajectory((Segment(now, now, rows, positions, goal),))


def segment(start: int, end: int, first: JointPoint, last: JointPoint, goal: str = "", splines: bool = True) -> Segment:
    """Return the segment between two points: quintic if both have velocities and accelerations, cubic if both have
    velocities, else linear, as ROS's JointTrajectoryController chooses. Without ``splines``, it jumps at its end.

    Args:
        start: Time of ``first``, ns.
        end: Time of ``last``, ns.
        first: The joints at the start.
        last: The joints at the end.
        goal: The ID of the goal that it belongs to.
        splines: Whether to interpolate at all.
    """
    duration = (end - start) / 1e9
    rows: list[Coefficients] = []
    for joint, (p0, p1) in enumerate(zip(first.positions, last.positions, strict=True)):
        if not splines or duration <= 0:
            rows.append((p0, 0.0, 0.0, 0.0, 0.0, 0.0))
        elif first.velocities is None or last.velocities is None:
            rows.append((p0, (p1 - p0) / duration, 0.0, 0.0, 0.0, 0.0))
        elif first.accelerations is None or last.accelerations is None:
            rows.append(cubic(p0, first.velocities[joint], p1, last.velocities[joint], duration))
        else:
            one = p0, first.velocities[joint], first.accelerations[joint]
            other = p1, last.velocities[joint], last.accelerations[joint]
            rows.append(quintic(one, other, duration))
    return Segment(start, end, tuple(rows), last.positions, goal)


def cubic(p0: float, v0: float, p1: float, v1: float, t: float) -> Coefficients:
    """Return the cubic from position ``p0`` and velocity ``v0`` to ``p1`` and ``v1`` within ``t`` [s]."""
    d = p1 - p0
    return p0, v0, (3 * d - (2 * v0 + v1) * t) / t**2, (-2 * d + (v0 + v1) * t) / t**3, 0.0, 0.0


def quintic(start: tuple[float, float, float], end: tuple[float, float, float], t: float) -> Coefficients:
    """Return the quintic from position, velocity and acceleration at ``start`` to those at ``end`` within ``t`` [s]."""
    (p0, v0, a0), (p1, v1, a1) = start, end
    d = p1 - p0
    return (
        p0,
        v0,
        a0 / 2,
        (20 * d - (3 * a0 - a1) * t**2 - (12 * v0 + 8 * v1) * t) / (2 * t**3),
        (-30 * d + (3 * a0 - 2 * a1) * t**2 + (16 * v0 + 14 * v1) * t) / (2 * t**4),
        (12 * d - (a0 - a1) * t**2 - 6 * (v0 + v1) * t) / (2 * t**5),
    )


def _polynomial(c: Sequence[float], t: float) -> tuple[float, float, float]:
    """Return value, first and second derivative of a quintic polynomial."""
    return (
        c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5])))),
        c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5]))),
        2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5])),
    )


@dataclass(frozen=True)
class StateTolerance:
    """Maximum error of one joint in position [rad or m] and velocity [rad/s or m/s]; 0 for no limit."""

    position: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True)
class Tolerances:
    """Tolerances by joint: ``path`` applies on the way, ``goal`` at the end, which must be reached within ``goal_time``
    [s] after it was due; None waits without limit."""

    path: Mapping[str, StateTolerance] = field(default_factory=dict)
    goal: Mapping[str, StateTolerance] = field(default_factory=dict)
    goal_time: float | None = 0.0


def default_tolerances(joints: Iterable[str], config: TrajectoryConfig) -> Tolerances:
    """Return the tolerances of a controller's configuration."""
    path, goal = {}, {}
    for joint in joints:
        if (stated := config.constraints.get(joint)) is not None and stated.trajectory:
            path[joint] = StateTolerance(stated.trajectory)
        goal[joint] = StateTolerance(stated.goal if stated is not None else 0.0, config.stopped_velocity_tolerance)
    unlimited = config.waits_for_goal and not config.goal_time
    return Tolerances(path, goal, None if unlimited else config.goal_time)


def goal_tolerances(goal: FollowJointTrajectoryGoal, defaults: Tolerances, joints: tuple[str, ...]) -> Tolerances:
    """Return the tolerances of a goal, which override the controller's ``defaults``; 0 keeps the default, a negative
    value means no limit.

    Raises BadInput for a joint that the controller does not have.
    """
    time = goal.goal_time_tolerance.ns / 1e9
    goal_time = defaults.goal_time if time == 0 else None if time < 0 else time
    path = _replaced(defaults.path, goal.path_tolerance, joints)
    return Tolerances(path, _replaced(defaults.goal, goal.goal_tolerance, joints), goal_time)


def violation(
    limits: Mapping[str, StateTolerance], joints: tuple[str, ...], errors: Iterable[float], rates: Iterable[float]
) -> str:
    """Describe the first violated limit; empty if there is none."""
    for joint, error, rate in zip(joints, errors, rates, strict=True):
        limit = limits.get(joint)
        if limit is None:
            continue
        if limit.position and abs(error) > limit.position:
            return f"{joint} is {abs(error):.4g} off, the limit is {limit.position:g}"
        if limit.velocity and abs(rate) > limit.velocity:
            return f"the velocity of {joint} is {abs(rate):.4g} off, the limit is {limit.velocity:g}"
    return ""


def _replaced(
    defaults: Mapping[str, StateTolerance], stated: Iterable[JointTolerance], joints: tuple[str, ...]
) -> dict[str, StateTolerance]:
    limits = dict(defaults)
    for each in stated:
        if each.name not in joints:
            raise unknown_name("joint", each.name, joints, "tolerance")
        limit = limits.get(each.name, StateTolerance())
        if each.position:
            limit = replace(limit, position=max(0.0, each.position))
        if each.velocity:
            limit = replace(limit, velocity=max(0.0, each.velocity))
        limits[each.name] = limit
    return limits
