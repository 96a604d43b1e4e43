"""Robots of this project, to be driven with ``services.sim.driving_trial``."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager

from messages.se3 import Pose3
from models import urdf_path
from models.model import RobotModel, WheelConfig, read_model
from models.world import WorldDescription
from services.runtime.step import STEP_NS
from services.runtime.step import STEP_S as DT
from services.sim.drive.driver import Drive
from services.sim.drive.kinematics import WheelGeometry
from services.sim.drive.limiter import AxisLimits, WheelRamp
from services.sim.driving_trial import DrivenRobot, drive_robots, turned, yaw_of
from services.sim.physics.world import Body, Motor, World

__all__ = ["DT", "STEP_NS", "DrivenRobot", "NewWorld", "Spawner", "drive_robots", "turned", "yaw_of"]


def placement_at(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Pose3:
    return Pose3((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))


def wheels_of(model: RobotModel) -> WheelConfig:
    assert model.wheels is not None
    return model.wheels


def ramped_drive(wheels: WheelConfig, *, clamp: bool = True, jump: float = 0.0) -> Drive:
    """Return the drive of wheels with a ramp; with ``clamp``, its axes are limited to the hardware's speeds."""
    v, w = (wheels.max_linear, wheels.max_angular) if clamp else (math.inf, math.inf)
    return Drive(
        WheelGeometry(wheels.separation, wheels.radius, wheels.radius),
        linear=AxisLimits(-v, v),
        angular=AxisLimits(-w, w),
        ramp=WheelRamp(wheels.acceleration, wheels.brake, jump),
    )


def robot_body(name: str, model: str, placement: Pose3) -> Body:
    wheels = wheels_of(read_model(model))
    motors = tuple(Motor(joint, wheels.torque) for joint in (wheels.left_joint, wheels.right_joint))
    return Body(name, urdf_path(model), placement, motors)


Spawner = Callable[..., DrivenRobot]
"""Spawns a robot in a test's world: name, model, placement, whether speeds are clamped."""

NewWorld = Callable[[WorldDescription], AbstractContextManager[World]]
"""Opens a world in a test's engine."""
