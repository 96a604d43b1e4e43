"""The steady law: turn towards the point, drive the leg, stop on the point, take the final heading."""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import NamedTuple

from services.motion.planar import STILL, Leg, Motion, Planar, wrap
from services.motion.profile import brake, course, limited, turn
from services.waypoint import WaypointParameters
from services.waypoint.plan import Goal

ALIGNED = 0.02
"""Heading error [rad] below which the robot sets off; 0.22 m/s over 0.2 s of lag make it 1 mm of offset."""
ASTRAY = 0.6
"""Heading error [rad] above which a driving robot stops and turns."""
REJOIN = 0.1
"""Offset [m] from the leg beyond which the robot, pushed or moved, takes the straight line from where it is."""
SHORT = 0.001
"""Distance left [m] at which the speed command ends; the approach speed there is 5 mm/s."""
REST = Motion(0.002, 0.02)
"""Measured speeds below which a robot stands."""
TURNED = 0.05
"""Measured turn rate [rad/s] below which an aligned robot sets off."""


class Stage(Enum):
    """What the robot is doing about its goal."""

    TURN = auto()
    DRIVE = auto()
    SETTLE = auto()
    ALIGN = auto()
    DONE = auto()


class Approach(NamedTuple):
    """The way to one goal: its leg, the stage, and the last command, from which the next may differ only so much."""

    goal: Goal
    leg: Leg
    stage: Stage = Stage.TURN
    command: Motion = STILL


def begin(goal: Goal, here: Planar, previous: Goal | None, command: Motion = STILL) -> Approach:
    """Start for ``goal``: on the leg from the ``previous`` goal if the robot is near it, else straight from here."""
    if previous is not None:
        leg = Leg(previous.x, previous.y, goal.x, goal.y)
        if leg.length > REJOIN and math.hypot(here.x - previous.x, here.y - previous.y) < REJOIN:
            return Approach(goal, leg, command=command)
    return Approach(goal, Leg(here.x, here.y, goal.x, goal.y), command=command)


def step(now: Approach, here: Planar, moving: Motion, p: WaypointParameters, dt: float) -> Approach:
    """The next stage and command, from the pose ``here`` and the measured velocity ``moving``; ``dt`` in s."""
    now = _staged(now, here, moving, p)
    wanted = _wanted(now, here, p)
    command = limited(now.command, wanted, p.acceleration * dt, p.deceleration * dt, p.angular_acceleration * dt)
    return now._replace(command=command)


def _staged(now: Approach, here: Planar, moving: Motion, p: WaypointParameters) -> Approach:
    away = now.leg.distance(here)
    standing = abs(moving.v) < REST.v and abs(moving.w) < REST.w
    match now.stage:
        case Stage.TURN if away <= p.tolerance:
            return now._replace(stage=Stage.SETTLE)
        case Stage.TURN if abs(_error(now, here, p)) < ALIGNED and abs(moving.w) < TURNED:
            return now._replace(stage=Stage.DRIVE)
        case Stage.DRIVE:
            left, offset = now.leg.left_and_offset(here)
            if left <= SHORT:
                return now._replace(stage=Stage.SETTLE)
            if abs(offset) > REJOIN:
                return begin(now.goal, here, None, now.command)
            if abs(_error(now, here, p)) > ASTRAY:
                return now._replace(stage=Stage.TURN)
        case Stage.SETTLE if standing and away > p.tolerance:
            return begin(now.goal, here, None, now.command)
        case Stage.SETTLE if standing:
            return now._replace(stage=Stage.DONE if now.goal.yaw is None else Stage.ALIGN)
        case Stage.ALIGN if standing and abs(_error(now, here, p)) < p.heading_tolerance:
            return now._replace(stage=Stage.DONE)
    return now


def _wanted(now: Approach, here: Planar, p: WaypointParameters) -> Motion:
    if now.stage in (Stage.SETTLE, Stage.DONE):
        return STILL
    error = _error(now, here, p)
    w = turn(error, p.max_angular, p.angular_acceleration, p.lag)
    if now.stage is not Stage.DRIVE:
        return Motion(0.0, w)
    left, _ = now.leg.left_and_offset(here)
    return Motion(brake(left, p.max_linear, p.deceleration, p.lag) * max(0.0, math.cos(error)), w)


def _error(now: Approach, here: Planar, p: WaypointParameters) -> float:
    """Heading error, rad. Below 4 lag v of lookahead the offset would swing: s^2 lag + s + v / lookahead = 0."""
    if now.stage is Stage.ALIGN and now.goal.yaw is not None:
        return wrap(now.goal.yaw - here.yaw)
    return wrap(course(now.leg, here, max(p.lookahead, 4 * p.lag * p.max_linear)) - here.yaw)
