"""The arm's joint without an engine: what a test of laws and loops needs of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

DT = 0.005
INERTIA, TORQUE, REST = 3.865, 27.148, math.radians(-1.4635)


@dataclass
class Pendulum:
    """At ``angle`` [rad], turning at ``rate`` [rad/s]."""

    angle: float = 0.0
    rate: float = 0.0

    def step(self, effort: float) -> None:
        """One physics step under an effort [N m]."""
        self.rate += DT * (effort - TORQUE * math.sin(self.angle - REST)) / INERTIA
        self.angle += DT * self.rate

    @property
    def degrees(self) -> float:
        return math.degrees(self.angle)

    @property
    def degrees_per_second(self) -> float:
        return math.degrees(self.rate)
