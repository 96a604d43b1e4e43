"""The ramp of the wheels themselves, each toward its own speed: the TurtleBot3 plugin's."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

JUMP = 0.01
"""m/s; the band of the Gazebo plugin's rule, see ``Ramp.jump``."""


@dataclass(frozen=True)
class Ramp:
    """How fast a wheel's rim changes its speed, m/s2: under command, and to a stop; inf: at once.

    ``jump`` [m/s] turns on the plugin's rule: when either wheel is nearer than this to its target, both take their
    targets at once. 0 turns it off: no wheel ever changes faster than the ramp.
    """

    acceleration: float = inf
    brake: float = inf
    jump: float = 0.0


NO_RAMP = Ramp()
"""Wheels that take any speed at once."""


def climb(ramp: Ramp, now: float, goal: float, most: float) -> float:
    """One rim's speed, moved from ``now`` toward ``goal`` by at most ``most`` [m/s]."""
    way = goal - now
    return goal if abs(way) <= most else now + (most if way > 0 else -most)


def advance_rims(
    ramp: Ramp, left: float, right: float, goals: tuple[float, float], stopping: bool, dt: float
) -> tuple[float, float]:
    """The rim speeds, left and right, m/s, one step of ``dt`` [s] later, judged on the commanded series."""
    goal_left, goal_right = goals
    most = (ramp.brake if stopping else ramp.acceleration) * dt
    if abs(goal_left - left) < ramp.jump or abs(goal_right - right) < ramp.jump:
        return goals
    return climb(ramp, left, goal_left, most), climb(ramp, right, goal_right, most)
