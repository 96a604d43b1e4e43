"""Collision avoidance: a velocity by reciprocal velocity obstacles, and the speed that still stops before a contact.

The velocity is the best of a fan of directions at two speeds. The cost of each is its deviation from the desired one
plus that of the time to a contact, where each of two moving robots makes half of the change (van den Berg, Lin,
Manocha: Reciprocal Velocity Obstacles, ICRA 2008). Right is slightly cheaper than left, so that two robots that meet
head-on, or block each other, turn to different sides of the line between them.

That choice may be wrong, since neighbours may do anything. What keeps robots apart is the speed limit, see
``forward_limit``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.se2 import Pose2
from services.driving.guidance import stopping_speed
from services.local_planner import LocalPlannerParameters
from services.local_planner.tracking import Obstacles

Floats = NDArray[np.float64]

DIRECTIONS = 36
_FAN = np.arange(-DIRECTIONS // 2, DIRECTIONS // 2) * (math.tau / DIRECTIONS)
_OFFSETS = np.concatenate((_FAN, _FAN))
"""Angles [rad] of the candidates relative to the goal's direction, at full and at half speed; counter-clockwise."""
_SPEEDS = np.repeat((1.0, 0.5), DIRECTIONS)
MOVING = 0.03
"""Speed [m/s] above which a disc is a robot that will make its half of a change."""
CONTACT_COST = 0.7
"""Cost of a contact, times seconds until then; a deviation by the full speed costs 1."""
CHANGE_COST = 0.15
"""Cost of a velocity that differs by the full speed from the previous choice, so that choices do not flicker."""
LEFT_COST = 0.015
"""Cost per radian to the left of the goal."""
_CHOICE_COST = LEFT_COST * np.maximum(_OFFSETS, 0.0)
_SOONEST_S = 0.05


class Velocity(NamedTuple):
    """A velocity in the odom frame [m/s]."""

    x: float
    y: float


ZERO_VELOCITY = Velocity(0.0, 0.0)


def choose_velocity(
    desired: Velocity, moving: Velocity, before: Velocity, here: Pose2, around: Obstacles, p: LocalPlannerParameters
) -> Velocity:
    """Return the velocity to choose among ``around``.

    Args:
        desired: The velocity without obstacles.
        moving: The present velocity.
        before: The velocity that was chosen last.
        here: The robot's pose.
        around: The present obstacles.
        p: The parameters.
    """
    top = math.hypot(*desired)
    if not len(around.positions) or not top:
        return desired
    angles = math.atan2(desired.y, desired.x) + _OFFSETS
    speeds = top * _SPEEDS
    x, y = speeds * np.cos(angles), speeds * np.sin(angles)
    soonest = np.maximum(_contact_times(x, y, moving, here, around, p).min(1), _SOONEST_S)
    cost = np.hypot(x - desired.x, y - desired.y) / p.max_linear + _CHOICE_COST
    cost += CHANGE_COST / p.max_linear * np.hypot(x - before.x, y - before.y)
    cost += CONTACT_COST * np.maximum(1 / soonest - 1 / p.horizon, 0.0)
    best = int(cost.argmin())
    return Velocity(float(x[best]), float(y[best]))


def _contact_times(
    x: Floats, y: Floats, moving: Velocity, here: Pose2, around: Obstacles, p: LocalPlannerParameters
) -> Floats:
    """Return the time [s] until each candidate (m,) meets each obstacle (n,), shape (m, n); inf for never."""
    to_x, to_y = around.positions[:, 0] - here.x, around.positions[:, 1] - here.y
    vx, vy = around.velocities[:, 0], around.velocities[:, 1]
    # Reciprocal: a moving robot is assumed to make half of the change, so candidate u is checked as 2 u - moving
    # against its constant velocity.
    gain = np.where(around.robots & (np.hypot(vx, vy) > MOVING), 2.0, 1.0)
    rel_x = np.outer(x - moving.x, gain) + (moving.x - vx)
    rel_y = np.outer(y - moving.y, gain) + (moving.y - vy)
    closing = rel_x * to_x + rel_y * to_y
    square = np.maximum(rel_x * rel_x + rel_y * rel_y, 1e-9)
    outside = to_x * to_x + to_y * to_y - contact_distances(around, p) ** 2
    inner = closing * closing - square * outside
    times = np.where(outside > 0, (closing - np.sqrt(np.maximum(inner, 0.0))) / square, 0.0)
    return np.where((closing > 0) & (inner > 0), times, np.inf)


def contact_distances(around: Obstacles, p: LocalPlannerParameters) -> Floats:
    """Return the distance [m] of the robot's axle from each centre at which the clearance is used up, (n,)."""
    return p.radius + p.overhang + p.clearance + np.where(around.robots, p.seen_radius, 0.0)


def forward_limit(here: Pose2, around: Obstacles, p: LocalPlannerParameters) -> float:
    """Return the highest forward speed [m/s] with which the robot stops in time for everything around.

    Towards each obstacle, the robot approaches at most at the speed that stops within the free distance, or half of it
    if the obstacle may be a robot: if both follow this rule, both stop before they touch. If a stop begins one scan
    later than possible, they come closer by at most (v - u) lag / 2, which the clearance covers. Objects behind or
    beside the robot impose no limit, and turning on the spot moves no point of it beyond its radius: a stopped robot
    can always turn, and leave in any free direction.
    """
    if not len(around.positions):
        return p.max_linear
    to_x, to_y = around.positions[:, 0] - here.x, around.positions[:, 1] - here.y
    away = np.maximum(np.hypot(to_x, to_y), 1e-6)
    ahead = (to_x * math.cos(here.yaw) + to_y * math.sin(here.yaw)) / away
    free = (away - contact_distances(around, p)) * np.where(around.robots, 0.5, 1.0)
    limit = p.max_linear
    for cosine, left in zip(ahead.tolist(), free.tolist(), strict=True):
        if cosine > 0:
            limit = min(limit, stopping_speed(left, p.max_linear, p.deceleration, p.lag) / cosine)
    return limit
