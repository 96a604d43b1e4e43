"""The systematic error of wheel odometry: wheels that are not of the size that it takes them for.

The three errors of Borenstein and Feng (IEEE Transactions on Robotics and Automation 12 (6), 1996): both wheels larger
or smaller than assumed, which scales every way; one wheel larger than the other, which bends a straight line; and
another separation, which scales every turn. They are drawn once for a robot and a seed, and hold for the whole run.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from models.model import OdometryErrorConfig
from services.sim.drive.kinematics import WheelGeometry
from services.sim.noise import noise_generator

MOST_DEVIATIONS = 2.0
"""Standard deviations at which a draw is cut off: a robot that is further off would be sent back."""


class ErrorDraws(NamedTuple):
    """How far one robot is off, in standard deviations: size and ratio of the wheels, and their separation."""

    wheel_radius: float
    wheel_radius_ratio: float
    wheel_separation: float


class OdometryError(NamedTuple):
    """What odometry takes the wheels for, as multiples of what they are."""

    left_radius: float = 1.0
    right_radius: float = 1.0
    separation: float = 1.0

    def describe(self) -> str:
        """How much too large odometry takes each figure for."""
        left, right, apart = (f"{(each - 1) * 100:+.2f} %" for each in self)
        return f"left radius {left}, right radius {right}, separation {apart}"


NO_ERROR = OdometryError()


def draw_errors(seed: int, robot: str) -> ErrorDraws:
    """The draws of a robot in a run; they depend on its name and the run's seed alone."""
    numbers = noise_generator(seed, robot, "odometry", 0).standard_normal(3)
    return ErrorDraws(*(max(-MOST_DEVIATIONS, min(MOST_DEVIATIONS, float(each))) for each in numbers))


def odometry_error(config: OdometryErrorConfig, multiple: float, draws: ErrorDraws) -> OdometryError:
    """The error of a robot whose model has the standard deviations ``config``, ``multiple`` times as large."""
    size = multiple * config.wheel_radius * draws.wheel_radius
    half_ratio = multiple * config.wheel_radius_ratio * draws.wheel_radius_ratio / 2
    apart = multiple * config.wheel_separation * draws.wheel_separation
    return OdometryError(math.exp(size - half_ratio), math.exp(size + half_ratio), math.exp(apart))


def assumed_geometry(geometry: WheelGeometry, error: OdometryError) -> WheelGeometry:
    """The wheels as odometry takes them for."""
    return geometry.scaled(error.separation, error.left_radius, error.right_radius)
