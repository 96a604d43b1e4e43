"""The limits of an axis in ROS's order (jerk, acceleration, velocity), and the acceleration ramp of wheels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf


@dataclass(frozen=True)
class AxisLimits:
    """Limits of one axis, m/s or rad/s and their derivatives; inf for none.

    Velocities are in [``min_velocity``, ``max_velocity``], which contains 0. ``accelerate`` and ``decelerate`` limit
    how fast a positive speed rises and falls, the two ``reverse`` limits how fast the size of a negative speed does;
    all are positive. ROS 1's sign-blind [-b, a] is accelerate = decelerate_reverse = a, decelerate = accelerate_reverse
    = b.

    ``min_jerk`` and ``max_jerk`` limit the change of acceleration, but only while the axis speeds up or slows down
    harder, as in ROS 2, so that no target is overshot. ``ros1_jerk`` limits every change, at twice the figures, as in
    ROS 1: its acceleration falls too late, and the speed swings about its target.
    """

    min_velocity: float = -inf
    max_velocity: float = inf
    accelerate: float = inf
    decelerate: float = inf
    accelerate_reverse: float = inf
    decelerate_reverse: float = inf
    min_jerk: float = -inf
    max_jerk: float = inf
    ros1_jerk: bool = False

    @cached_property
    def limits_acceleration(self) -> bool:
        """Whether any acceleration is limited."""
        return min(self.accelerate, self.decelerate, self.accelerate_reverse, self.decelerate_reverse) < inf

    @cached_property
    def limits_jerk(self) -> bool:
        """Whether any jerk is limited."""
        return self.min_jerk > -inf or self.max_jerk < inf


UNLIMITED = AxisLimits()
"""No limit."""


def limit(axis: AxisLimits, target: float, last: float, before: float, dt: float) -> float:
    """Return the speed one step of ``dt`` [s] after ``last``, as near to ``target`` as the limits allow.

    ``before`` is the speed one step before ``last``. Limits apply to commanded speeds, not to measured ones.
    """
    speed = target
    if axis.limits_jerk:
        speed = _limit_jerk(axis, speed, last, before, dt)
    if axis.limits_acceleration and speed != last:
        speed = _limit_acceleration(axis, speed, last, dt)
    top, low = axis.max_velocity, axis.min_velocity
    return top if speed > top else low if speed < low else speed


def braking_limits(axis: AxisLimits, brake: float) -> AxisLimits:
    """Return the limits of the axis while it stops with the deceleration ``brake``; jerk is unlimited then."""
    return AxisLimits(
        axis.min_velocity, axis.max_velocity, axis.accelerate, brake, axis.accelerate_reverse, decelerate_reverse=brake
    )


def _limit_jerk(axis: AxisLimits, target: float, last: float, before: float, dt: float) -> float:
    had, gets = last - before, target - last
    change = gets - had
    if not axis.ros1_jerk and change * gets <= 0.0:
        return target
    square = (2.0 if axis.ros1_jerk else 1.0) * dt * dt
    low, high = axis.min_jerk * square, axis.max_jerk * square
    if low <= change <= high:
        return target
    return last + had + (low if change < low else high)


def _limit_acceleration(axis: AxisLimits, target: float, last: float, dt: float) -> float:
    if last > 0.0 or (last == 0.0 and target > 0.0):
        return _approach(target, last, axis.accelerate, axis.decelerate, axis.accelerate_reverse, dt)
    # Mirrored; a difference, because the negative of 0.0 is -0.0.
    return 0.0 - _approach(-target, -last, axis.accelerate_reverse, axis.decelerate_reverse, axis.accelerate, dt)


def _approach(target: float, last: float, up: float, down: float, beyond: float, dt: float) -> float:
    """Move ``last`` >= 0 toward ``target``: by ``up`` or ``down``, and past zero by ``beyond`` for the rest of
    ``dt``."""
    if target >= last:
        return min(target, last + up * dt)
    lowest = last - down * dt
    if target >= 0.0 or lowest >= 0.0 or down == beyond:
        return max(target, lowest)
    remaining = dt - last / down
    return max(target, -beyond * remaining) if beyond < inf else target


@dataclass(frozen=True)
class WheelRamp:
    """Limits of the acceleration of a wheel's rim, m/s2: under command, and when braking; inf for none.

    ``jump`` [m/s] turns on the rule of Gazebo's plugin: if either wheel is nearer than this to its target, both jump to
    their targets. 0 turns it off: no wheel ever changes faster than the ramp.
    """

    acceleration: float = inf
    brake: float = inf
    jump: float = 0.0


NO_RAMP = WheelRamp()
"""Wheels without a limit of acceleration."""


def ramp_toward(speed: float, goal: float, max_change: float) -> float:
    """Return a rim's speed, moved from ``speed`` toward ``goal`` by at most ``max_change`` [m/s]."""
    difference = goal - speed
    return goal if abs(difference) <= max_change else speed + (max_change if difference > 0 else -max_change)


def ramp_wheels(
    ramp: WheelRamp, left: float, right: float, goals: tuple[float, float], stopping: bool, dt: float
) -> tuple[float, float]:
    """Return the rim speeds, left and right, m/s, after ``dt`` [s]; based on commanded, not measured speeds."""
    goal_left, goal_right = goals
    max_change = (ramp.brake if stopping else ramp.acceleration) * dt
    if abs(goal_left - left) < ramp.jump or abs(goal_right - right) < ramp.jump:
        return goals
    return ramp_toward(left, goal_left, max_change), ramp_toward(right, goal_right, max_change)
