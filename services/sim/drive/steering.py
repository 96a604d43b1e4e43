"""The steered wheels of a base with Ackermann steering."""

from __future__ import annotations

import math
from dataclasses import dataclass

from models.model import SteeredWheel, SteeringConfig
from services.runtime.step import STEP_S
from services.sim.physics.world import BodyHandle

GAIN = 0.5
"""Share of the angle error that is corrected in one step; with 1, wheels tremble."""


@dataclass(frozen=True)
class Steering:
    """Steering by one angle: that of a virtual wheel in the middle, ``wheelbase`` [m] ahead of the driven axle.

    The base turns about a point on the line of that axle, with the curvature tan(angle) / wheelbase. ``angle`` is at
    most ``max_angle`` [rad] and changes at ``rate`` [rad/s].
    """

    wheels: tuple[SteeredWheel, ...]
    wheelbase: float
    max_angle: float
    rate: float

    @classmethod
    def of(cls, config: SteeringConfig) -> Steering:
        """Return the steering of a model."""
        wheelbase = max(abs(each.ahead) for each in config.wheels)
        return cls(config.wheels, wheelbase, math.atan(wheelbase * config.max_curvature), config.rate)

    def curvature(self, angle: float) -> float:
        """Return the curvature of the path at an angle, 1/m, positive to the left."""
        return math.tan(angle) / self.wheelbase

    def goal(self, v: float, w: float, angle: float) -> float:
        """Return the angle [rad] for a command [m/s, rad/s]: ``angle`` for zero, the largest for a turn on the spot."""
        if not v:
            return math.copysign(self.max_angle, w) if w else angle
        return max(-self.max_angle, min(self.max_angle, math.atan(self.wheelbase * w / v)))

    def toward(self, goal: float, angle: float, dt: float) -> float:
        """Return the angle [rad] that is reached ``dt`` [s] after ``angle`` on the way to ``goal``."""
        max_change = self.rate * dt
        return goal if abs(goal - angle) <= max_change else angle + math.copysign(max_change, goal - angle)

    def wheel_angles(self, angle: float) -> tuple[float, ...]:
        """Return the angles of the steering joints, rad: each wheel is perpendicular to the line to the turning point.

        tan(a) = k x / (1 - k y), with the curvature k and the wheel's position (x, y) relative to the middle of the
        axle.
        """
        k = self.curvature(angle)
        angles = (math.atan(k * each.ahead / (1 - k * each.left)) for each in self.wheels)
        return tuple(-a if each.reversed else a for a, each in zip(angles, self.wheels, strict=True))


class SteeringServo:
    """Turns the steered wheels of a body by their motors' speeds."""

    def __init__(self, body: BodyHandle, steering: Steering) -> None:
        self._body, self._steering = body, steering
        self._indices = tuple(body.joints.index(each.joint) for each in steering.wheels)

    def speeds(self, angle: float) -> tuple[float, ...]:
        """Return the speeds [rad/s] of the steering joints for one step, toward the angle of the middle wheel."""
        angles, fastest = self._body.joint_readings().position, 3 * self._steering.rate
        goals = zip(self._indices, self._steering.wheel_angles(angle), strict=True)
        return tuple(max(-fastest, min(fastest, GAIN * (goal - angles[index]) / STEP_S)) for index, goal in goals)
