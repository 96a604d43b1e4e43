"""From a velocity command to wheel speeds, once per physics step: a two-wheeled base with the TurtleBot3 plugin's ramp.

A driver is three things: a frozen record of limits, a small state, and a pure function from one state to the next that
returns the *same* state when nothing changes. Another kind of base brings its own three.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from models.figures import Wheels

JUMP = 0.01
"""m/s; the band of the Gazebo plugin's rule, see ``Limits.jump``."""


@dataclass(frozen=True)
class Limits:
    """Geometry in m; speeds in m/s and rad/s; ``acceleration`` and ``brake`` of a wheel's rim in m/s2.

    ``max_linear`` and ``max_angular`` are inf for a base that obeys any command, as Gazebo's plugin did.
    ``jump`` [m/s] turns on the plugin's rule: when either wheel is nearer than this to its target, both take their
    targets at once. 0 turns it off: no wheel ever changes faster than the ramp.
    """

    separation: float
    radius: float
    max_linear: float
    max_angular: float
    acceleration: float
    brake: float
    jump: float = 0.0

    @classmethod
    def of(cls, wheels: Wheels, *, clamp: bool = True, jump: float = 0.0) -> Limits:
        """The limits of a model; without ``clamp`` any commanded speed is obeyed."""
        return cls(
            separation=wheels.separation,
            radius=wheels.radius,
            max_linear=wheels.max_linear if clamp else inf,
            max_angular=wheels.max_angular if clamp else inf,
            acceleration=wheels.acceleration,
            brake=wheels.brake,
            jump=jump,
        )


class Rims(NamedTuple):
    """The commanded speeds of the wheels' rims, m/s, forward positive."""

    left: float = 0.0
    right: float = 0.0


AT_REST = Rims()


def target(limits: Limits, v: float, w: float) -> tuple[float, float]:
    """The rim speeds for forward speed ``v`` [m/s] and turn rate ``w`` [rad/s], both finite.

    Each of the two is clamped to its limit by itself, as the hardware does; then left = v - w b/2, right = v + w b/2
    with the wheel separation b.
    """
    # Comparisons instead of min and max: this runs for every robot at every step.
    top = limits.max_linear
    v = top if v > top else -top if v < -top else v
    top = limits.max_angular
    w = top if w > top else -top if w < -top else w
    half = w * limits.separation / 2
    return v - half, v + half


def advance(limits: Limits, rims: Rims, v: float, w: float, braking: bool, dt: float) -> Rims:
    """The rim speeds one step of ``dt`` [s] later; ``rims`` itself if they are where they should be.

    Each wheel moves toward its target by at most ``acceleration * dt``, judged on the commanded series. ``braking``
    replaces the command by a standstill, approached at ``brake``. About 1 us.
    """
    if braking:
        goal_left = goal_right = 0.0
        most = limits.brake * dt
    else:
        goal_left, goal_right = target(limits, v, w)
        most = limits.acceleration * dt
    left, right = goal_left - rims.left, goal_right - rims.right
    if left == 0.0 == right:
        return rims
    if abs(left) < limits.jump or abs(right) < limits.jump:
        return Rims(goal_left, goal_right)
    return Rims(
        goal_left if abs(left) <= most else rims.left + (most if left > 0 else -most),
        goal_right if abs(right) <= most else rims.right + (most if right > 0 else -most),
    )


def wheel_speeds(limits: Limits, rims: Rims) -> tuple[float, float]:
    """The wheels' turn rates, left and right, rad/s."""
    return rims.left / limits.radius, rims.right / limits.radius
