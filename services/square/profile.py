"""The default control law: ramped profiles along each side and turn, to rest at absolute corners."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from messages.se2 import ZERO_TWIST, Pose2, Twist2, wrap
from services.driving.guidance import STANDSTILL, limit_slew, line_of_sight_heading, stopping_speed
from services.square import SquareParameters
from services.square.corners import QUARTER_TURN, Square, StepResult

GAIN = 2.0
"""Gain of position and heading errors [1/s]; with a delay of 0.1 s it oscillates from 3.7 on (1/e / delay)."""
DELAY = 0.015
"""Expected delay [s] behind the profile: 0.005 if commands act at once, 0.025 if a tick later."""
LOOKAHEAD = 0.3
"""Distance [m] over which an offset from the side is corrected."""
LAG = 0.1
"""Loop delay [s] that the lookahead allows for, see ``_heading_error``."""
CATCH_UP_FACTOR = 1.2
"""Largest speed to catch up with the profile, relative to its maximum speed."""
MAX_LAG = Pose2(0.1, 0.1, 0.2)
"""Lag [m, rad] beyond which the profile waits for the robot: the base is too slow or blocked."""
DISPLACED = 0.5
"""Distance from the profile [m] beyond which the robot must have been displaced: it stops."""


class Phase(Enum):
    """Phases of driving to one corner."""

    DRIVE = "drive"
    TURN = "turn"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class ProfileState:
    """State of driving to the corner ``index``.

    Attributes:
        square: The square.
        index: Index of the corner.
        phase: Driving along the side, turning at its end, or done.
        position: Position of the profile along the side [m] or turn [rad].
        speed: Speed of the profile [m/s or rad/s].
        settling_time: Time since the profile ended [s].
        command: The last command.
        displaced: The robot was displaced and stops.
    """

    square: Square
    index: int = 0
    phase: Phase = Phase.DRIVE
    position: float = 0.0
    speed: float = 0.0
    settling_time: float = 0.0
    command: Twist2 = ZERO_TWIST
    displaced: bool = False

    @property
    def length(self) -> float:
        """Length of the profile: m along a side, rad at a corner."""
        return self.square.side if self.phase is Phase.DRIVE else QUARTER_TURN

    @property
    def desired(self) -> Pose2:
        """Desired pose at the current position of the profile."""
        corner, heading = self.square.corner(self.index), self.square.heading(self.index)
        if self.phase is not Phase.DRIVE:
            return Pose2(corner.x, corner.y, wrap(heading + self.position))
        back = self.square.side - self.position
        return Pose2(corner.x - back * math.cos(heading), corner.y - back * math.sin(heading), wrap(heading))


def resume(state: ProfileState, here: Pose2) -> ProfileState:
    """Resume after a standstill: continue the profile from where the robot is."""
    at = _position_along(state, here)
    return replace(
        state,
        position=max(0.0, min(state.length, at)),
        speed=0.0,
        settling_time=0.0,
        command=ZERO_TWIST,
        displaced=False,
    )


def step(
    state: ProfileState, here: Pose2, velocity: Twist2, p: SquareParameters, dt: float
) -> tuple[ProfileState, StepResult]:
    """Return the state after ``dt`` [s] and its result, from the measured pose and velocity."""
    if state.phase is Phase.DONE:
        return state, StepResult("finished", ZERO_TWIST, state.index, state.desired, "done")
    if state.displaced or math.hypot(here.x - state.desired.x, here.y - state.desired.y) > DISPLACED:
        state = replace(resume(state, here), displaced=True)
        if math.hypot(here.x - state.desired.x, here.y - state.desired.y) > MAX_LAG.x:
            return state, StepResult("waiting", ZERO_TWIST, state.index, state.desired, "astray")
        state = replace(state, displaced=False)
    behind = state.position - state.speed * DELAY - _position_along(state, here)
    state = _advance_profile(state, behind, p, dt)
    command = _command(state, behind, here, p, dt)
    state = replace(
        state, command=command, settling_time=state.settling_time + dt if state.position >= state.length else 0.0
    )
    late = state.settling_time > p.patience
    if not (late or _settled(state, here, velocity, p)):
        return state, StepResult("driving", state.command, state.index, state.desired, state.phase.value)
    if state.phase is Phase.DRIVE:
        state = replace(state, phase=Phase.TURN, position=0.0, speed=0.0, settling_time=0.0)
        return state, StepResult("driving", state.command, state.index, state.desired, "turn", late)
    reached = StepResult("reached", ZERO_TWIST, state.index, state.desired, "turn", late)
    if state.index + 1 == state.square.corner_count:
        return replace(state, phase=Phase.DONE, command=ZERO_TWIST), reached
    return ProfileState(state.square, state.index + 1), reached


def _advance_profile(state: ProfileState, behind: float, p: SquareParameters, dt: float) -> ProfileState:
    """Advance the profile by one step: accelerate, cruise, decelerate to rest at its end.

    It waits while the robot is too far ``behind`` [m or rad].
    """
    if dt <= 0:
        return state
    drive = state.phase is Phase.DRIVE
    max_speed, gap = (p.linear_speed, MAX_LAG.x) if drive else (p.angular_speed, MAX_LAG.yaw)
    rise, fall = (p.acceleration, p.deceleration) if drive else (p.angular_acceleration, p.angular_acceleration)
    if behind > gap:
        return replace(state, speed=max(0.0, state.speed - fall * dt))
    target = stopping_speed(state.length - state.position, max_speed, fall, dt)
    speed = max(state.speed - fall * dt, min(state.speed + rise * dt, target))
    at = state.position + speed * dt
    # The end of braking is exponential; below a micrometre or microradian it counts as complete.
    return (
        replace(state, position=state.length, speed=0.0)
        if state.length - at < 1e-6
        else replace(state, position=at, speed=speed)
    )


def _command(state: ProfileState, behind: float, here: Pose2, p: SquareParameters, dt: float) -> Twist2:
    """Return the profile's speed, corrected by the error along it, and on a side by the offset from it."""
    if state.phase is Phase.DRIVE:
        error = _clamp(behind, MAX_LAG.x)
        turn = _clamp(GAIN * _heading_error(state, here, p), p.angular_speed)
        slow = max(0.0, math.cos(wrap(state.square.heading(state.index) - here.yaw)))
        target = Twist2(_clamp(state.speed + GAIN * error, CATCH_UP_FACTOR * p.linear_speed) * slow, turn)
    else:
        error = _clamp(behind, MAX_LAG.yaw)
        target = Twist2(0.0, _clamp(state.speed + GAIN * error, CATCH_UP_FACTOR * p.angular_speed))
    return limit_slew(state.command, target, p.acceleration * dt, p.deceleration * dt, p.angular_acceleration * dt)


def _position_along(state: ProfileState, here: Pose2) -> float:
    """Return the position of the robot along the side [m] or turn [rad]."""
    if state.phase is Phase.DRIVE:
        remaining, _ = state.square.segment(state.index).remaining_and_offset(here)
        return state.square.side - remaining
    return wrap(here.yaw - state.square.heading(state.index) - QUARTER_TURN / 2) + QUARTER_TURN / 2


def _heading_error(state: ProfileState, here: Pose2, p: SquareParameters) -> float:
    """Return the heading error [rad] from the course back onto the side, or from the side itself once the profile has
    ended.

    A lookahead below 4 v (1/GAIN + LAG) would make the offset oscillate: s^2 (1/GAIN + LAG) + s + v / lookahead = 0.
    """
    if state.position >= state.length:
        return wrap(state.square.heading(state.index) - here.yaw)
    ahead = max(LOOKAHEAD, 4 * (LAG + 1 / GAIN) * p.linear_speed)
    return wrap(line_of_sight_heading(state.square.segment(state.index), here, ahead) - here.yaw)


def _settled(state: ProfileState, here: Pose2, velocity: Twist2, p: SquareParameters) -> bool:
    """Whether the phase is complete: at rest within the tolerance."""
    tolerance = p.tolerance if state.phase is Phase.DRIVE else p.heading_tolerance
    standing = abs(velocity.v) <= STANDSTILL.v and abs(velocity.w) <= STANDSTILL.w
    return (
        state.position >= state.length and standing and abs(state.position - _position_along(state, here)) <= tolerance
    )


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
