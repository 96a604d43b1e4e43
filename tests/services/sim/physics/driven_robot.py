"""Robots driven as the simulation drives them: one step of the ramp before each physics step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from messages.se3 import Pose3
from models import urdf_path
from models.model import RobotModel, WheelConfig, read_model
from services.sim.drive.driver import AT_REST, Drive, DriveState, step_drive, wheel_speeds
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Body, BodyState, Motor

STEP_NS = 5_000_000
DT = STEP_NS / 1e9


def placement_at(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Pose3:
    return Pose3((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))


def wheels_of(model: RobotModel) -> WheelConfig:
    assert model.wheels is not None
    return model.wheels


def robot_body(name: str, model: str, placement: Pose3) -> Body:
    wheels = wheels_of(read_model(model))
    motors = tuple(Motor(joint, wheels.torque) for joint in (wheels.left_joint, wheels.right_joint))
    return Body(name, urdf_path(model), placement, motors)


def yaw_of(state: BodyState) -> float:
    x, y, z, w = state.orientation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


@dataclass
class DrivenRobot:
    """A base under constant commands, driven as ``drive_robots`` says."""

    world: BulletWorld
    name: str
    drive: Drive
    state: DriveState = field(default=AT_REST)

    def set(self, v: float, w: float, *, braking: bool = False) -> None:
        after = step_drive(self.drive, self.state, v, w, braking, DT)
        if after is not self.state:
            self.state = after
            self.world.set_speeds(self.name, wheel_speeds(self.drive, after))


def drive_robots(
    drivers: Sequence[DrivenRobot], v: float, w: float, seconds: float, *, braking: bool = False
) -> list[BodyState]:
    """Command all for a time; returns the states of the first after each step."""
    states = []
    for _ in range(round(seconds / DT)):
        for each in drivers:
            each.set(v, w, braking=braking)
        drivers[0].world.step()
        states.append(drivers[0].world.state(drivers[0].name))
    return states


Spawner = Callable[..., DrivenRobot]
"""Puts a robot into the world of a test: name, model, placement, whether speeds are clamped."""
