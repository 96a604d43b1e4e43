"""The limits of an axis in ROS's order (jerk, acceleration, velocity), and the acceleration ramp of wheels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf


@dataclass(frozen=True)
class AxisLimits:
    """Limits of one axis, m/s or rad/s and their derivatives; inf where there is none.

    Velocities lie in [``min_velocity``, ``max_velocity``], which holds 0. ``accelerate`` and ``decelerate`` bound how
    fast a positive speed grows and falls, the two of ``reverse`` the size of a negative one; all are positive.
    ROS 1's sign-blind [-b, a] is accelerate = decelerate_reverse = a, decelerate = accelerate_reverse = b.

    ``min_jerk`` and ``max_jerk`` bound the change of acceleration: while the axis speeds up or slows down harder, as
    ROS 2 does, so that no target is overshot. ``ros1_jerk`` bounds every change, at twice the figures, as ROS 1 does:
    its acceleration falls too late, and the speed swings about its target.
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


def limit(axis: AxisLimits, wanted: float, last: float, before: float, dt: float) -> float:
    """The speed one step of ``dt`` [s] after ``last``, as near to ``wanted`` as the limits allow.

    ``before`` is the speed one step before ``last``. All are judged on the commanded series, not on measured speeds.
    """
    speed = wanted
    if axis.limits_jerk:
        speed = _limit_jerk(axis, speed, last, before, dt)
    if axis.limits_acceleration and speed != last:
        speed = _limit_acceleration(axis, speed, last, dt)
    top, low = axis.max_velocity, axis.min_velocity
    return top if speed > top else low if speed < low else speed


def braking_limits(axis: AxisLimits, brake: float) -> AxisLimits:
    """The axis while it comes to a stop at ``brake``: an emergency knows no jerk."""
    return AxisLimits(
        axis.min_velocity, axis.max_velocity, axis.accelerate, brake, axis.accelerate_reverse, decelerate_reverse=brake
    )


def _limit_jerk(axis: AxisLimits, wanted: float, last: float, before: float, dt: float) -> float:
    had, gets = last - before, wanted - last
    change = gets - had
    if not axis.ros1_jerk and change * gets <= 0.0:
        return wanted
    square = (2.0 if axis.ros1_jerk else 1.0) * dt * dt
    low, high = axis.min_jerk * square, axis.max_jerk * square
    if low <= change <= high:
        return wanted
    return last + had + (low if change < low else high)


def _limit_acceleration(axis: AxisLimits, wanted: float, last: float, dt: float) -> float:
    if last > 0.0 or (last == 0.0 and wanted > 0.0):
        return _approach(wanted, last, axis.accelerate, axis.decelerate, axis.accelerate_reverse, dt)
    # Seen in a mirror; a difference, because the negative of 0.0 is -0.0.
    return 0.0 - _approach(-wanted, -last, axis.accelerate_reverse, axis.decelerate_reverse, axis.accelerate, dt)


def _approach(wanted: float, last: float, up: float, down: float, beyond: float, dt: float) -> float:
    """``last`` >= 0 moved toward ``wanted``: up, down, and ``beyond`` zero with what is left of the step."""
    if wanted >= last:
        return min(wanted, last + up * dt)
    lowest = last - down * dt
    if wanted >= 0.0 or lowest >= 0.0 or down == beyond:
        return max(wanted, lowest)
    left = dt - last / down
    return max(wanted, -beyond * left) if beyond < inf else wanted


@dataclass(frozen=True)
class WheelRamp:
    """How fast a wheel's rim changes its speed, m/s2: under command, and to a stop; inf: at once.

    ``jump`` [m/s] turns on the plugin's rule: when either wheel is nearer than this to its target, both take their
    targets at once. 0 turns it off: no wheel ever changes faster than the ramp.
    """

    acceleration: float = inf
    brake: float = inf
    jump: float = 0.0


NO_RAMP = WheelRamp()
"""Wheels that take any speed at once."""


def ramp_toward(now: float, goal: float, most: float) -> float:
    """One rim's speed, moved from ``now`` toward ``goal`` by at most ``most`` [m/s]."""
    way = goal - now
    return goal if abs(way) <= most else now + (most if way > 0 else -most)


def ramp_wheels(
    ramp: WheelRamp, left: float, right: float, goals: tuple[float, float], stopping: bool, dt: float
) -> tuple[float, float]:
    """The rim speeds, left and right, m/s, one step of ``dt`` [s] later, judged on the commanded series."""
    goal_left, goal_right = goals
    most = (ramp.brake if stopping else ramp.acceleration) * dt
    if abs(goal_left - left) < ramp.jump or abs(goal_right - right) < ramp.jump:
        return goals
    return ramp_toward(left, goal_left, most), ramp_toward(right, goal_right, most)
