"""A model of the arm's joint without a physics engine, to test control laws and loops."""

from __future__ import annotations

import math
from dataclasses import dataclass

DT = 0.005
INERTIA, TORQUE, REST = 3.865, 27.148, math.radians(-1.4635)


@dataclass
class Pendulum:
    """A joint at ``angle`` [rad] turning at ``rate`` [rad/s]."""

    angle: float = 0.0
    rate: float = 0.0

    def step(self, effort: float) -> None:
        """Advance by one physics step under an effort [N m]."""
        self.rate += DT * (effort - TORQUE * math.sin(self.angle - REST)) / INERTIA
        self.angle += DT * self.rate

    @property
    def degrees(self) -> float:
        return math.degrees(self.angle)

    @property
    def degrees_per_second(self) -> float:
        return math.degrees(self.rate)
