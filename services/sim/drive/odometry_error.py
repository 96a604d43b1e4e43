"""The systematic error of wheel odometry, which assumes wheels of slightly wrong size.

The three errors of Borenstein and Feng (IEEE Transactions on Robotics and Automation 12 (6), 1996): both wheels larger
or smaller than assumed, which scales every distance; one wheel larger than the other, which bends a straight line; and
another separation, which scales every turn. They are drawn once per robot and seed, and hold for the whole run.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from models.model import OdometryErrorConfig
from services.sim.drive.kinematics import WheelGeometry
from services.sim.noise import noise_generator

MAX_DEVIATIONS = 2.0
"""Standard deviations at which a draw is cut off: a robot with a larger error would be returned as faulty."""


class ErrorDraws(NamedTuple):
    """The errors of one robot in standard deviations: size and ratio of the wheels, and their separation."""

    wheel_radius: float
    wheel_radius_ratio: float
    wheel_separation: float


class OdometryError(NamedTuple):
    """The geometry that odometry assumes, as multiples of the true values."""

    left_radius: float = 1.0
    right_radius: float = 1.0
    separation: float = 1.0

    def describe(self) -> str:
        """Return the relative errors as text, in %."""
        left, right, apart = (f"{(each - 1) * 100:+.2f} %" for each in self)
        return f"left radius {left}, right radius {right}, separation {apart}"


NO_ERROR = OdometryError()


def draw_errors(seed: int, robot: str) -> ErrorDraws:
    """Draw the errors of a robot; they depend on its name and the run's seed alone."""
    numbers = noise_generator(seed, robot, "odometry", 0).standard_normal(3)
    return ErrorDraws(*(max(-MAX_DEVIATIONS, min(MAX_DEVIATIONS, float(each))) for each in numbers))


def odometry_error(config: OdometryErrorConfig, multiple: float, draws: ErrorDraws) -> OdometryError:
    """Return the error of a robot, from the model's standard deviations ``config`` times ``multiple``."""
    size = multiple * config.wheel_radius * draws.wheel_radius
    half_ratio = multiple * config.wheel_radius_ratio * draws.wheel_radius_ratio / 2
    apart = multiple * config.wheel_separation * draws.wheel_separation
    return OdometryError(math.exp(size - half_ratio), math.exp(size + half_ratio), math.exp(apart))


def assumed_geometry(geometry: WheelGeometry, error: OdometryError) -> WheelGeometry:
    """Return the wheel geometry that odometry assumes."""
    return geometry.scaled(error.separation, error.left_radius, error.right_radius)
