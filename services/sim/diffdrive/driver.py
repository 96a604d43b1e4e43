"""From a velocity command to wheel speeds, once per physics step.

A driver is three things: a frozen record of limits, a small state, and a pure function from one state to the next that
returns the *same* state when nothing changes. Another kind of base brings its own three.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from models.figures import Wheels
from services.sim.diffdrive.geometry import Geometry, body_speeds, rim_speeds
from services.sim.diffdrive.limiter import FREE, Axis, limit
from services.sim.diffdrive.ramp import NO_RAMP, Ramp, advance_rims


@dataclass(frozen=True)
class Drive:
    """What a command passes: the limits of the two axes, then the geometry, then the ramp of the wheels.

    ``stop_linear`` and ``stop_angular`` replace the limits while the base brakes, after a time-out or an emergency
    stop. ``keep_curvature`` slows both axes together, so that a limited command bends as the wanted one does.
    """

    geometry: Geometry
    linear: Axis = FREE
    angular: Axis = FREE
    stop_linear: Axis = FREE
    stop_angular: Axis = FREE
    ramp: Ramp = NO_RAMP
    keep_curvature: bool = False

    @classmethod
    def of(cls, wheels: Wheels, *, clamp: bool = True, jump: float = 0.0) -> Drive:
        """The TurtleBot3's driver: axes clamped to the hardware's speeds, or not, and wheels that ramp."""
        v, w = (wheels.max_linear, wheels.max_angular) if clamp else (inf, inf)
        return cls(
            Geometry(wheels.separation, wheels.radius, wheels.radius),
            linear=Axis(-v, v),
            angular=Axis(-w, w),
            ramp=Ramp(wheels.acceleration, wheels.brake, jump),
        )


class State(NamedTuple):
    """The limited command (m/s, rad/s), for jerk limits the one of the step before, and the speeds of the rims, m/s."""

    v: float = 0.0
    w: float = 0.0
    v_before: float = 0.0
    w_before: float = 0.0
    left: float = 0.0
    right: float = 0.0


AT_REST = State()


def advance(drive: Drive, state: State, v: float, w: float, braking: bool, dt: float) -> State:
    """The state one step of ``dt`` [s] later under the command ``v`` [m/s], ``w`` [rad/s], both finite.

    It is ``state`` itself when nothing changes.

    Each axis is limited by itself. ``braking`` replaces the command by a standstill. 2 us; 6 with all limits.
    """
    linear, angular = drive.linear, drive.angular
    if braking:
        v = w = 0.0
        linear, angular = drive.stop_linear, drive.stop_angular
    elif drive.keep_curvature:
        v, w = _fit(drive, v, w)
    after_v = limit(linear, v, state.v, state.v_before, dt)
    after_w = limit(angular, w, state.w, state.w_before, dt)
    if drive.keep_curvature and not braking:
        after_v, after_w = _together(state, (v, w), (after_v, after_w))
    goals = rim_speeds(drive.geometry, after_v, after_w)
    rims = advance_rims(drive.ramp, state.left, state.right, goals, braking, dt)
    had_v, had_w = state.v if linear.jerks else after_v, state.w if angular.jerks else after_w
    after = State(after_v, after_w, had_v, had_w, *rims)
    return state if after == state else after


def wheel_speeds(drive: Drive, state: State) -> tuple[float, float]:
    """The wheels' turn rates, left and right, rad/s."""
    return state.left / drive.geometry.left_radius, state.right / drive.geometry.right_radius


def commanded(drive: Drive, state: State) -> tuple[float, float]:
    """What the wheels are told, as speed [m/s] and turn rate [rad/s] of the base: the command after all limits."""
    if drive.ramp.acceleration == drive.ramp.brake == inf:
        return state.v, state.w
    return body_speeds(drive.geometry, state.left, state.right)


def _fit(drive: Drive, v: float, w: float) -> tuple[float, float]:
    """The command made smaller as a whole until both axes may have it."""
    share = 1.0
    for wanted, axis in ((v, drive.linear), (w, drive.angular)):
        top = axis.max_velocity if wanted > 0 else -axis.min_velocity
        if abs(wanted) > top:
            share = min(share, top / abs(wanted))
    return (v, w) if share == 1.0 else (v * share, w * share)


def _together(state: State, wanted: tuple[float, float], allowed: tuple[float, float]) -> tuple[float, float]:
    """Both axes changed by the same share of their ways, that of the slower one; a smaller change breaks no limit."""
    share = 1.0
    for now, goal, can in zip(state, wanted, allowed, strict=False):
        if goal != now:
            share = min(share, (can - now) / (goal - now))
    if share >= 1.0:
        return wanted
    return state.v + share * (wanted[0] - state.v), state.w + share * (wanted[1] - state.w)
