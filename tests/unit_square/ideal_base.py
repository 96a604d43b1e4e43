"""An ideal base for tests: speed and turn rate ramp, each by itself, no slip, physics in steps of 5 ms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from services.motion.planar import STILL, Motion, Planar
from services.square import SquareParameters
from services.square.move import Move
from services.square.pilot import Pilot

PHYSICS = 0.005
CONTROL = 0.02
ORIGIN = Planar(0.0, 0.0)
LINEAR, ANGULAR = 0.3, 1.745329
"""The Pioneer's limits in the tutorial, m/s2 and rad/s2."""


@dataclass(frozen=True, slots=True)
class Instant:
    """What was true at ``time`` [s], and what the pilot made of it."""

    time: float
    here: Planar
    moving: Motion
    move: Move


class IdealBase:
    """Pose and speeds; a command takes effect as far as the limits let it. ``top`` is the fastest it goes, m/s."""

    def __init__(self, start: Planar = ORIGIN, top: float = math.inf) -> None:
        self.here, self.moving, self.top = start, STILL, top

    def ramp(self, command: Motion) -> Motion:
        """The motion of one physics step."""
        rise, spin = LINEAR * PHYSICS, ANGULAR * PHYSICS
        v = max(-self.top, min(self.top, command.v))
        self.moving = Motion(
            self.moving.v + max(-rise, min(rise, v - self.moving.v)),
            self.moving.w + max(-spin, min(spin, command.w - self.moving.w)),
        )
        return self.moving

    def run(self, command: Motion) -> None:
        """One control period under a command."""
        for _ in range(round(CONTROL / PHYSICS)):
            moving = self.ramp(command)
            middle = self.here.yaw + moving.w * PHYSICS / 2
            self.here = Planar(
                self.here.x + moving.v * PHYSICS * math.cos(middle),
                self.here.y + moving.v * PHYSICS * math.sin(middle),
                self.here.yaw + moving.w * PHYSICS,
            )


def drive(p: SquareParameters, base: IdealBase, seconds: float = 400.0) -> Iterator[Instant]:
    """Pilot and base together until the square is finished or the time is over; the base keeps the last command."""
    pilot, command = Pilot(p), STILL
    for tick in range(round(seconds / CONTROL)):
        now = round(tick * CONTROL * 1e9)
        move = pilot.step(now, base.here, base.moving, CONTROL if tick else 0.0)
        yield Instant(tick * CONTROL, base.here, base.moving, move)
        if move.state == "finished":
            return
        command = move.command or command
        base.run(command)
