"""An ideal base for tests: two wheels with limited acceleration, no slip, physics steps of 5 ms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from messages.se2 import ZERO_TWIST, Pose2, Twist2
from services.driving.plan import Progress
from services.waypoint.controller import WaypointController

PHYSICS_S = 0.005
CONTROL_S = 0.04
SEPARATION = 0.16
WHEEL_ACCELERATION = 1.0


@dataclass(frozen=True, slots=True)
class SimulatedStep:
    """The true state at ``time`` [s], and the controller's output."""

    time: float
    pose: Pose2
    velocity: Twist2
    progress: Progress


class IdealBase:
    """A base with pose and wheel speeds that follows commands within the wheels' acceleration."""

    def __init__(self, start: Pose2) -> None:
        self.pose, self.left, self.right = start, 0.0, 0.0

    @property
    def velocity(self) -> Twist2:
        return Twist2((self.left + self.right) / 2, (self.right - self.left) / SEPARATION)

    def run(self, command: Twist2) -> None:
        """Run one control period under a command."""
        change = WHEEL_ACCELERATION * PHYSICS_S
        for _ in range(round(CONTROL_S / PHYSICS_S)):
            left, right = command.v - command.w * SEPARATION / 2, command.v + command.w * SEPARATION / 2
            self.left += max(-change, min(change, left - self.left))
            self.right += max(-change, min(change, right - self.right))
            v, w = self.velocity.v, self.velocity.w
            middle = self.pose.yaw + w * PHYSICS_S / 2
            self.pose = Pose2(
                self.pose.x + v * PHYSICS_S * math.cos(middle),
                self.pose.y + v * PHYSICS_S * math.sin(middle),
                self.pose.yaw + w * PHYSICS_S,
            )


def drive(pilot: WaypointController, start: Pose2, seconds: float) -> Iterator[SimulatedStep]:
    """Run controller and base, each command one control period late, until finished or out of time."""
    base, late = IdealBase(start), ZERO_TWIST
    for tick in range(round(seconds / CONTROL_S)):
        progress = pilot.step(base.pose, base.velocity, CONTROL_S)
        yield SimulatedStep(tick * CONTROL_S, base.pose, base.velocity, progress)
        if progress.state == "finished":
            return
        base.run(late)
        late = progress.command or ZERO_TWIST
