"""From a velocity command to wheel speeds, once per physics step.

A driver consists of a frozen record of limits, a small state, and a pure function from one state to the next that
returns the *same* state when nothing changes. Another kind of base adds its own three.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from services.sim.drive.kinematics import WheelGeometry, body_velocity, rim_speeds
from services.sim.drive.limiter import NO_RAMP, UNLIMITED, AxisLimits, WheelRamp, limit, ramp_wheels
from services.sim.drive.steering import Steering


@dataclass(frozen=True)
class Drive:
    """The stages that a command passes: the limits of the two axes, the geometry, and the ramp of the wheels.

    ``stop_linear`` and ``stop_angular`` replace the limits while the base brakes, after a time-out or an emergency
    stop. ``keep_curvature`` slows both axes together, so that a limited command keeps its curvature.
    A ``holonomic`` base also moves sideways, within the limits of ``linear``. A base with ``steering`` turns by its
    steered wheels, and only while it drives.
    """

    geometry: WheelGeometry
    linear: AxisLimits = UNLIMITED
    angular: AxisLimits = UNLIMITED
    stop_linear: AxisLimits = UNLIMITED
    stop_angular: AxisLimits = UNLIMITED
    ramp: WheelRamp = NO_RAMP
    keep_curvature: bool = False
    holonomic: bool = False
    steering: Steering | None = None


class DriveState(NamedTuple):
    """The limited command [m/s, rad/s], that of the step before (for jerk limits), the rim speeds [m/s], the limited
    sideways command [m/s], and the steering angle [rad]."""

    v: float = 0.0
    w: float = 0.0
    v_before: float = 0.0
    w_before: float = 0.0
    left: float = 0.0
    right: float = 0.0
    vy: float = 0.0
    steer: float = 0.0


AT_REST = DriveState()


def step_drive(
    drive: Drive, state: DriveState, v: float, w: float, braking: bool, dt: float, vy: float = 0.0
) -> DriveState:
    """Return the state after ``dt`` [s] under the command ``v`` [m/s], ``w`` [rad/s], ``vy`` [m/s] sideways.

    It is ``state`` itself when nothing changes. Each axis is limited separately. ``braking`` replaces the command by
    standstill. Takes 2 us; 6 us with all limits.
    """
    if drive.steering is not None:
        return _step_steered(drive, drive.steering, state, v, w, braking, dt)
    linear, angular = drive.linear, drive.angular
    if braking:
        v = w = vy = 0.0
        linear, angular = drive.stop_linear, drive.stop_angular
    elif drive.keep_curvature:
        v, w = _scale_to_limits(drive, v, w)
    after_v = limit(linear, v, state.v, state.v_before, dt)
    after_w = limit(angular, w, state.w, state.w_before, dt)
    if drive.keep_curvature and not braking:
        after_v, after_w = _keep_curvature(state, (v, w), (after_v, after_w))
    goals = rim_speeds(drive.geometry, after_v, after_w)
    rims = ramp_wheels(drive.ramp, state.left, state.right, goals, braking, dt)
    had_v, had_w = state.v if linear.limits_jerk else after_v, state.w if angular.limits_jerk else after_w
    sideways = limit(linear, vy, state.vy, state.vy, dt) if drive.holonomic else 0.0
    after = DriveState(after_v, after_w, had_v, had_w, *rims, sideways)
    return state if after == state else after


def _step_steered(
    drive: Drive, steering: Steering, state: DriveState, v: float, w: float, braking: bool, dt: float
) -> DriveState:
    """Like ``step_drive``, for a base that turns by its steered wheels: w = v tan(angle) / wheelbase."""
    if braking:
        v = w = 0.0
    linear = drive.stop_linear if braking else drive.linear
    after_v = limit(linear, v, state.v, state.v_before, dt)
    w = max(drive.angular.min_velocity, min(drive.angular.max_velocity, w))
    steer = steering.toward(steering.goal(v, w, state.steer), state.steer, dt)
    after_w = after_v * steering.curvature(steer)
    rims = rim_speeds(drive.geometry, after_v, after_w)
    had_v = state.v if linear.limits_jerk else after_v
    after = DriveState(after_v, after_w, had_v, after_w, *rims, 0.0, steer)
    return state if after == state else after


def wheel_speeds(drive: Drive, state: DriveState) -> tuple[float, float]:
    """Return the wheels' turn rates, left and right, rad/s."""
    return state.left / drive.geometry.left_radius, state.right / drive.geometry.right_radius


def commanded_velocity(drive: Drive, state: DriveState) -> tuple[float, float]:
    """Return the commanded wheel speeds, as speed [m/s] and turn rate [rad/s] of the base, after all limits."""
    if drive.ramp.acceleration == drive.ramp.brake == inf:
        return state.v, state.w
    return body_velocity(drive.geometry, state.left, state.right)


def _scale_to_limits(drive: Drive, v: float, w: float) -> tuple[float, float]:
    """Scale down the command as a whole until both axes are within their velocity limits."""
    share = 1.0
    for target, axis in ((v, drive.linear), (w, drive.angular)):
        top = axis.max_velocity if target > 0 else -axis.min_velocity
        if abs(target) > top:
            share = min(share, top / abs(target))
    return (v, w) if share == 1.0 else (v * share, w * share)


def _keep_curvature(
    state: DriveState, target: tuple[float, float], allowed: tuple[float, float]
) -> tuple[float, float]:
    """Scale both axes' changes by the share that the slower one allows; a smaller change breaks no limit."""
    share = 1.0
    for now, goal, can in zip(state, target, allowed, strict=False):
        if goal != now:
            share = min(share, (can - now) / (goal - now))
    if share >= 1.0:
        return target
    return state.v + share * (target[0] - state.v), state.w + share * (target[1] - state.w)
