"""An ideal base for tests: speed and turn rate ramp, each by itself, no slip, physics in steps of 5 ms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from messages.se2 import ZERO_TWIST, Pose2, Twist2
from services.square import SquareParameters
from services.square.controller import SquareController
from services.square.corners import StepResult

PHYSICS_S = 0.005
CONTROL_S = 0.02
ORIGIN = Pose2(0.0, 0.0)
LINEAR, ANGULAR = 0.3, 1.745329
"""The Pioneer's limits in the tutorial, m/s2 and rad/s2."""


@dataclass(frozen=True, slots=True)
class SimulatedStep:
    """What was true at ``time`` [s], and what the pilot made of it."""

    time: float
    pose: Pose2
    velocity: Twist2
    move: StepResult


class IdealBase:
    """Pose and speeds; a command takes effect as far as the limits let it. ``top`` is the fastest it goes, m/s."""

    def __init__(self, start: Pose2 = ORIGIN, top: float = math.inf) -> None:
        self.pose, self.velocity, self.top = start, ZERO_TWIST, top

    def ramp(self, command: Twist2) -> Twist2:
        """The motion of one physics step."""
        rise, spin = LINEAR * PHYSICS_S, ANGULAR * PHYSICS_S
        v = max(-self.top, min(self.top, command.v))
        self.velocity = Twist2(
            self.velocity.v + max(-rise, min(rise, v - self.velocity.v)),
            self.velocity.w + max(-spin, min(spin, command.w - self.velocity.w)),
        )
        return self.velocity

    def run(self, command: Twist2) -> None:
        """One control period under a command."""
        for _ in range(round(CONTROL_S / PHYSICS_S)):
            moving = self.ramp(command)
            middle = self.pose.yaw + moving.w * PHYSICS_S / 2
            self.pose = Pose2(
                self.pose.x + moving.v * PHYSICS_S * math.cos(middle),
                self.pose.y + moving.v * PHYSICS_S * math.sin(middle),
                self.pose.yaw + moving.w * PHYSICS_S,
            )


def drive(p: SquareParameters, base: IdealBase, seconds: float = 400.0) -> Iterator[SimulatedStep]:
    """Pilot and base together until the square is finished or the time is over; the base keeps the last command."""
    pilot, command = SquareController(p), ZERO_TWIST
    for tick in range(round(seconds / CONTROL_S)):
        now = round(tick * CONTROL_S * 1e9)
        move = pilot.step(now, base.pose, base.velocity, CONTROL_S if tick else 0.0)
        yield SimulatedStep(tick * CONTROL_S, base.pose, base.velocity, move)
        if move.state == "finished":
            return
        command = move.command or command
        base.run(command)
