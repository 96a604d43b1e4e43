"""An ideal base for tests: two wheels that ramp at a limited acceleration, no slip, physics in steps of 5 ms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from services.motion.planar import STILL, Motion, Planar
from services.waypoint.pilot import Pilot, Progress

PHYSICS = 0.005
CONTROL = 0.04
SEPARATION = 0.16
WHEEL_ACCELERATION = 1.0


@dataclass(frozen=True, slots=True)
class Instant:
    """What was true at ``time`` [s], and what the pilot made of it."""

    time: float
    here: Planar
    moving: Motion
    progress: Progress


class IdealBase:
    """Pose and wheel speeds; a command takes effect as far as the wheels can accelerate."""

    def __init__(self, start: Planar) -> None:
        self.here, self.left, self.right = start, 0.0, 0.0

    @property
    def moving(self) -> Motion:
        return Motion((self.left + self.right) / 2, (self.right - self.left) / SEPARATION)

    def run(self, command: Motion) -> None:
        """One control period under a command."""
        change = WHEEL_ACCELERATION * PHYSICS
        for _ in range(round(CONTROL / PHYSICS)):
            left, right = command.v - command.w * SEPARATION / 2, command.v + command.w * SEPARATION / 2
            self.left += max(-change, min(change, left - self.left))
            self.right += max(-change, min(change, right - self.right))
            v, w = self.moving.v, self.moving.w
            middle = self.here.yaw + w * PHYSICS / 2
            self.here = Planar(
                self.here.x + v * PHYSICS * math.cos(middle),
                self.here.y + v * PHYSICS * math.sin(middle),
                self.here.yaw + w * PHYSICS,
            )


def drive(pilot: Pilot, start: Planar, seconds: float) -> Iterator[Instant]:
    """Run pilot and base together, each command one control period late, until finished or out of time."""
    base, late = IdealBase(start), STILL
    for tick in range(round(seconds / CONTROL)):
        progress = pilot.step(base.here, base.moving, CONTROL)
        yield Instant(tick * CONTROL, base.here, base.moving, progress)
        if progress.state == "finished":
            return
        base.run(late)
        late = progress.command or STILL
