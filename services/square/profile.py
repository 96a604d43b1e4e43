"""The default law: each side and each turn follows a ramped profile to an absolute corner, and ends at rest on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from services.motion.planar import STILL, Motion, Planar, wrap
from services.motion.profile import brake, course, limited
from services.square import SquareParameters
from services.square.corners import QUARTER, Square
from services.square.move import Move

GAIN = 2.0
"""Speed per error, 1/s, along the side and of the heading; a delay of 0.1 s makes it ring from 3.7 on (1/e / delay)."""
DELAY = 0.015
"""Time [s] by which a robot that keeps up trails its profile: 0.005 where commands act at once, 0.025 a tick later."""
LOOKAHEAD = 0.3
"""Distance [m] over which an offset from the side is taken out."""
LAG = 0.1
"""Delay [s] of the loop that the lookahead allows for, see ``_aside``."""
CATCH_UP = 1.2
"""How much faster than its profile a robot may go to catch up with it."""
GAP = Planar(0.1, 0.1, 0.2)
"""Lag behind the profile [m, rad] from which on the profile waits: the base is slower than told, or held up."""
ASTRAY = 0.5
"""Distance from the profile [m] at which the robot must have been moved by somebody: it stands still."""
REST = Motion(0.002, 0.02)
"""Measured speeds below which a robot stands."""


class Stage(Enum):
    """What the robot is doing about its corner."""

    DRIVE = "drive"
    TURN = "turn"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Course:
    """The way to the corner ``index``: stage, how far the profile has come, m or rad, and at what speed.

    ``settling`` counts the seconds since the profile ended; ``astray`` tells that the robot was moved.
    """

    square: Square
    index: int = 0
    stage: Stage = Stage.DRIVE
    at: float = 0.0
    speed: float = 0.0
    settling: float = 0.0
    command: Motion = STILL
    astray: bool = False

    @property
    def length(self) -> float:
        """How far the profile of this stage goes: m along a side, rad at a corner."""
        return self.square.side if self.stage is Stage.DRIVE else QUARTER

    @property
    def desired(self) -> Planar:
        """The pose that the profile asks for now."""
        corner, heading = self.square.corner(self.index), self.square.heading(self.index)
        if self.stage is not Stage.DRIVE:
            return Planar(corner.x, corner.y, wrap(heading + self.at))
        back = self.square.side - self.at
        return Planar(corner.x - back * math.cos(heading), corner.y - back * math.sin(heading), wrap(heading))


def resume(now: Course, here: Planar) -> Course:
    """The course after a standstill: the profile goes on from where the robot is."""
    at = _along(now, here)
    return replace(now, at=max(0.0, min(now.length, at)), speed=0.0, settling=0.0, command=STILL, astray=False)


def step(now: Course, here: Planar, moving: Motion, p: SquareParameters, dt: float) -> tuple[Course, Move]:
    """The course ``dt`` [s] on, and the move, from the pose ``here`` and the measured velocity ``moving``."""
    if now.stage is Stage.DONE:
        return now, Move("finished", STILL, now.index, now.desired, "done")
    if now.astray or math.hypot(here.x - now.desired.x, here.y - now.desired.y) > ASTRAY:
        now = replace(resume(now, here), astray=True)
        if math.hypot(here.x - now.desired.x, here.y - now.desired.y) > GAP.x:
            return now, Move("waiting", STILL, now.index, now.desired, "astray")
        now = replace(now, astray=False)
    behind = now.at - now.speed * DELAY - _along(now, here)
    now = _advanced(now, behind, p, dt)
    command = _command(now, behind, here, p, dt)
    now = replace(now, command=command, settling=now.settling + dt if now.at >= now.length else 0.0)
    late = now.settling > p.patience
    if not (late or _settled(now, here, moving, p)):
        return now, Move("driving", now.command, now.index, now.desired, now.stage.value)
    if now.stage is Stage.DRIVE:
        now = replace(now, stage=Stage.TURN, at=0.0, speed=0.0, settling=0.0)
        return now, Move("driving", now.command, now.index, now.desired, "turn", late)
    reached = Move("reached", STILL, now.index, now.desired, "turn", late)
    if now.index + 1 == now.square.turns:
        return replace(now, stage=Stage.DONE, command=STILL), reached
    return Course(now.square, now.index + 1), reached


def _advanced(now: Course, behind: float, p: SquareParameters, dt: float) -> Course:
    """The profile one step on: constant rise, cruise, constant fall, to rest at its end.

    It waits for a robot that is too far ``behind`` it, m or rad.
    """
    if dt <= 0:
        return now
    drive = now.stage is Stage.DRIVE
    top, gap = (p.linear_speed, GAP.x) if drive else (p.angular_speed, GAP.yaw)
    rise, fall = (p.acceleration, p.deceleration) if drive else (p.angular_acceleration, p.angular_acceleration)
    if behind > gap:
        return replace(now, speed=max(0.0, now.speed - fall * dt))
    wanted = brake(now.length - now.at, top, fall, dt)
    speed = max(now.speed - fall * dt, min(now.speed + rise * dt, wanted))
    at = now.at + speed * dt
    # The last step of the brake is an exponential; below a micrometre or microradian it is over.
    return replace(now, at=now.length, speed=0.0) if now.length - at < 1e-6 else replace(now, at=at, speed=speed)


def _command(now: Course, behind: float, here: Planar, p: SquareParameters, dt: float) -> Motion:
    """The profile's speed, corrected by the error along it; on a side the heading is held by the offset from it."""
    if now.stage is Stage.DRIVE:
        error = _bounded(behind, GAP.x)
        turn = _bounded(GAIN * _aside(now, here, p), p.angular_speed)
        slow = max(0.0, math.cos(wrap(now.square.heading(now.index) - here.yaw)))
        wanted = Motion(_bounded(now.speed + GAIN * error, CATCH_UP * p.linear_speed) * slow, turn)
    else:
        error = _bounded(behind, GAP.yaw)
        wanted = Motion(0.0, _bounded(now.speed + GAIN * error, CATCH_UP * p.angular_speed))
    return limited(now.command, wanted, p.acceleration * dt, p.deceleration * dt, p.angular_acceleration * dt)


def _along(now: Course, here: Planar) -> float:
    """How far the robot has come on this stage: m along the side, rad of the turn."""
    if now.stage is Stage.DRIVE:
        left, _ = now.square.leg(now.index).left_and_offset(here)
        return now.square.side - left
    return wrap(here.yaw - now.square.heading(now.index) - QUARTER / 2) + QUARTER / 2


def _aside(now: Course, here: Planar, p: SquareParameters) -> float:
    """Heading error [rad] against the course that leads back onto the side; of the side alone once it is driven.

    Below 4 v (1/GAIN + LAG) of lookahead the offset would swing: s^2 (1/GAIN + LAG) + s + v / lookahead = 0.
    """
    if now.at >= now.length:
        return wrap(now.square.heading(now.index) - here.yaw)
    ahead = max(LOOKAHEAD, 4 * (LAG + 1 / GAIN) * p.linear_speed)
    return wrap(course(now.square.leg(now.index), here, ahead) - here.yaw)


def _settled(now: Course, here: Planar, moving: Motion, p: SquareParameters) -> bool:
    """Whether this stage is over: at rest within the tolerance."""
    tolerance = p.tolerance if now.stage is Stage.DRIVE else p.heading_tolerance
    standing = abs(moving.v) <= REST.v and abs(moving.w) <= REST.w
    return now.at >= now.length and standing and abs(now.at - _along(now, here)) <= tolerance


def _bounded(value: float, most: float) -> float:
    return max(-most, min(most, value))
