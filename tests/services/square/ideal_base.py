"""An ideal base for tests: independent ramps of speed and turn rate, no slip, physics steps of 5 ms."""

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
"""The Pioneer's acceleration limits in the tutorial [m/s2, rad/s2]."""


@dataclass(frozen=True, slots=True)
class SimulatedStep:
    """The true state at ``time`` [s], and the controller's output."""

    time: float
    pose: Pose2
    velocity: Twist2
    move: StepResult


class IdealBase:
    """A base with pose and speeds that follows commands within its limits; ``top`` is its maximum speed [m/s]."""

    def __init__(self, start: Pose2 = ORIGIN, top: float = math.inf) -> None:
        self.pose, self.velocity, self.top = start, ZERO_TWIST, top

    def ramp(self, command: Twist2) -> Twist2:
        """Return the velocity after one physics step."""
        rise, spin = LINEAR * PHYSICS_S, ANGULAR * PHYSICS_S
        v = max(-self.top, min(self.top, command.v))
        self.velocity = Twist2(
            self.velocity.v + max(-rise, min(rise, v - self.velocity.v)),
            self.velocity.w + max(-spin, min(spin, command.w - self.velocity.w)),
        )
        return self.velocity

    def run(self, command: Twist2) -> None:
        """Run one control period under a command."""
        for _ in range(round(CONTROL_S / PHYSICS_S)):
            moving = self.ramp(command)
            middle = self.pose.yaw + moving.w * PHYSICS_S / 2
            self.pose = Pose2(
                self.pose.x + moving.v * PHYSICS_S * math.cos(middle),
                self.pose.y + moving.v * PHYSICS_S * math.sin(middle),
                self.pose.yaw + moving.w * PHYSICS_S,
            )


def drive(p: SquareParameters, base: IdealBase, seconds: float = 400.0) -> Iterator[SimulatedStep]:
    """Run controller and base until the square is finished or time is up; the base keeps the last command."""
    pilot, command = SquareController(p), ZERO_TWIST
    for tick in range(round(seconds / CONTROL_S)):
        now = round(tick * CONTROL_S * 1e9)
        move = pilot.step(now, base.pose, base.velocity, CONTROL_S if tick else 0.0)
        yield SimulatedStep(tick * CONTROL_S, base.pose, base.velocity, move)
        if move.state == "finished":
            return
        command = move.command or command
        base.run(command)
