"""A robot in MuJoCo: its share of the engine's arrays, which it reads and writes itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, Rotation, Vector, add_cross, rotate, rotate_inverse
from services.runtime.errors import unknown_name
from services.sim.physics.mujoco_robot import RobotTree
from services.sim.physics.mujoco_scene import PlacedRobot, wxyz
from services.sim.physics.world import (
    Body,
    BodyState,
    Configuration,
    Inertia,
    JointFriction,
    JointReadings,
    MotorTarget,
)

Floats = NDArray[np.float64]

ROOT_POSITIONS, ROOT_VELOCITIES = 7, 6
"""Numbers of a free root: its position and quaternion, its velocity (world axes) and turn rate (its own axes)."""
MAX_EFFORT = 1e9
"""N m or N, limit of a motor without one."""


class PartStates(Protocol):
    """What a body needs from its world: the poses and velocities of its parts."""

    def positions_changed(self) -> None:
        """Mark derived positions as out of date, after positions were set."""

    def part_pose(self, body: str, part: int) -> Pose3:
        """Return the pose of a part's frame in the world."""

    def part_state(self, body: str, part: int) -> BodyState:
        """Return pose and velocity of a part's frame in the world."""

    def joint_inertias(self, body: str) -> Floats:
        """Return the inertia about each rate of the body, the root's six first unless it is fixed."""

    def push(self, body: str, part: int, force: Vector, torque: Vector, point: Vector) -> None:
        """Apply a wrench to a part in the next step."""


class BodyArrays:
    """A body's share of the engine's arrays; arrays of its own until it is part of a compiled model.

    Rates begin with the root's six, unless it is fixed; a motor keeps ``targets`` with at most ``limits``.
    """

    def __init__(self, positions: int, rates: int) -> None:
        self.positions, self.velocities, self.warmstart = np.zeros(positions), np.zeros(rates), np.zeros(rates)
        self.targets, self.limits, self.damping = np.zeros(rates), np.zeros(rates), np.zeros(rates)
        self.applied, self.motor_efforts = np.zeros(rates), np.zeros(rates)
        self.base = np.zeros(ROOT_POSITIONS)
        """The pose of a fixed root."""


class MujocoBody:
    """Implements ``BodyHandle``."""

    def __init__(self, world: PartStates, description: Body, tree: RobotTree) -> None:
        self.description, self.tree, self._world = description, tree, world
        self.limited_damping: Mapping[str, float] = {}
        """Always empty: the engine can simulate any damping."""
        self.fixed = description.fixed
        positions, rates = (0, 0) if self.fixed else (ROOT_POSITIONS, ROOT_VELOCITIES)
        self.arrays = BodyArrays(positions + len(tree.parts) - 1, rates + len(tree.parts) - 1)
        self._position_of = {joint: positions + part - 1 for joint, part in tree.joints.items()}
        self._rate_of = {joint: rates + part - 1 for joint, part in tree.joints.items()}
        self._joints = tuple(tree.joints)
        self.joint_positions = np.array(list(self._position_of.values()), np.intp)
        self.joint_rates = np.array(list(self._rate_of.values()), np.intp)
        self._check_names()
        self.motors = np.array([self._rate_of[motor.joint] for motor in description.motors], np.intp)
        self.max_torques = np.array([min(motor.torque, MAX_EFFORT) for motor in description.motors])
        self.start()

    def start(self) -> None:
        """Return the body to its spawn configuration, at rest, its motors at zero."""
        description, arrays = self.description, self.arrays
        arrays.positions[:] = 0.0
        for each in (arrays.velocities, arrays.warmstart, arrays.targets, arrays.limits, arrays.applied):
            each[:] = 0.0
        arrays.motor_efforts[:] = 0.0
        self.place(description.pose)
        self.set_joints(dict(description.initial_positions))
        for joint, index in self._rate_of.items():
            arrays.damping[index] = self.tree.damping(joint)
        self._set_joint_friction(dict(description.joint_friction))
        arrays.limits[self.motors] = self.max_torques

    @property
    def placed(self) -> PlacedRobot:
        """The body in the form that a scene needs."""
        description = self.description
        return PlacedRobot(description.name, self.tree, description.pose, self.fixed, description.slides)

    @property
    def joints(self) -> tuple[str, ...]:
        return self._joints

    @property
    def links(self) -> tuple[str, ...]:
        return tuple(self.tree.links)

    @property
    def motor_joints(self) -> tuple[str, ...]:
        return tuple(motor.joint for motor in self.description.motors)

    @property
    def configuration(self) -> Configuration:
        """The current root pose and joint positions."""
        positions = self.arrays.positions[self.joint_positions].tolist()
        return Configuration(self.root_pose, dict(zip(self._joints, positions, strict=True)))

    @property
    def root_pose(self) -> Pose3:
        """The pose of the root in the world."""
        place = self.arrays.base if self.fixed else self.arrays.positions
        x, y, z, w, i, j, k = place[:ROOT_POSITIONS].tolist()
        return Pose3((x, y, z), (i, j, k, w))

    def state(self) -> BodyState:
        pose = self.root_pose
        if self.fixed:
            return BodyState(*pose, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        vx, vy, vz, i, j, k = self.arrays.velocities[:ROOT_VELOCITIES].tolist()
        return BodyState(*pose, (vx, vy, vz), rotate(pose.orientation, (i, j, k)))

    def place(self, pose: Pose3) -> None:
        """Set the pose of the root frame, without a check."""
        place = self.arrays.base if self.fixed else self.arrays.positions
        place[:ROOT_POSITIONS] = (*pose.position, *wxyz(pose.orientation))
        self._world.positions_changed()

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Set joint positions, at rest, without a check."""
        for joint, position in positions.items():
            self.arrays.positions[self._position_of[joint]] = position
            self.arrays.velocities[self._rate_of[joint]] = 0.0
        self._world.positions_changed()

    def set_velocity(self, linear: Vector, angular: Vector) -> None:
        if not self.fixed:
            orientation = self.root_pose.orientation
            self.arrays.velocities[:ROOT_VELOCITIES] = (*linear, *rotate_inverse(orientation, angular))

    def set_speeds(self, speeds: Sequence[float]) -> None:
        self.arrays.targets[self.motors] = speeds
        self.arrays.limits[self.motors] = self.max_torques

    def set_torques(self, torques: Sequence[float]) -> None:
        self.arrays.limits[self.motors] = 0.0
        self.arrays.applied[self.motors] += torques

    def set_efforts(self, efforts: Mapping[str, float]) -> None:
        for joint, effort in efforts.items():
            self.arrays.applied[self.rate_index(joint)] += effort

    def drive_joints(self, targets: Mapping[str, MotorTarget]) -> None:
        arrays = self.arrays
        for index, target in [(self.rate_index(joint), target) for joint, target in targets.items()]:
            arrays.targets[index], arrays.limits[index] = target.velocity, min(target.effort, MAX_EFFORT)

    def release_joints(self, joints: Sequence[str]) -> None:
        friction = dict(self.description.joint_friction)
        self.drive_joints({joint: MotorTarget(0.0, friction.get(joint, JointFriction()).friction) for joint in joints})

    def set_joint_friction(self, joint_friction: Mapping[str, JointFriction]) -> None:
        self._set_joint_friction(joint_friction)
        every = {**dict(self.description.joint_friction), **joint_friction}
        self.description = replace(self.description, joint_friction=tuple(every.items()))

    def _set_joint_friction(self, joint_friction: Mapping[str, JointFriction]) -> None:
        # Dry friction is a motor with a target speed of 0 and its force as the limit.
        self.drive_joints({joint: MotorTarget(0.0, each.friction) for joint, each in joint_friction.items()})
        for joint, each in joint_friction.items():
            self.arrays.damping[self._rate_of[joint]] = each.damping

    def joint_inertias(self) -> tuple[float, ...]:
        inertias = self._world.joint_inertias(self.description.name)
        return tuple(inertias[self.joint_rates].tolist())

    def joint_readings(self) -> JointReadings:
        arrays = self.arrays
        return JointReadings(
            tuple(arrays.positions[self.joint_positions].tolist()),
            tuple(arrays.velocities[self.joint_rates].tolist()),
            tuple(arrays.motor_efforts[self.joint_rates].tolist()),
        )

    def link_pose(self, link: str) -> Pose3:
        part, place = self.link_place(link)
        return (self.root_pose if part == 0 else self._world.part_pose(self.description.name, part)) @ place

    def link_state(self, link: str) -> BodyState:
        part, place = self.link_place(link)
        moves = self.state() if part == 0 else self._world.part_state(self.description.name, part)
        arm = rotate(moves.orientation, place.position)
        pose = Pose3(moves.position, moves.orientation) @ place
        return BodyState(*pose, add_cross(moves.linear, moves.angular, arm), moves.angular)

    def inertia(self, link: str) -> Inertia:
        self.link_place(link)
        return self.tree.inertias[link]

    def apply_wrench(self, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        part, _ = self.link_place(link)
        if part:
            self._world.push(self.description.name, part, force, torque, point)
        elif not self.fixed:
            position, orientation = self.root_pose
            x, y, z = (a - b for a, b in zip(point, position, strict=True))
            about = add_cross(torque, (x, y, z), force)
            self.arrays.applied[:ROOT_VELOCITIES] += (*force, *rotate_inverse(orientation, about))

    def rate_index(self, joint: str) -> int:
        """Return the index of a movable joint's rate; raises BadInput with the joints available."""
        if joint not in self._rate_of:
            raise unknown_name("joint", joint, self._rate_of, self.description.name)
        return self._rate_of[joint]

    def link_place(self, link: str) -> tuple[int, Pose3]:
        """Return the part of a link and its pose in it; raises BadInput with the links available."""
        if link not in self.tree.links:
            raise unknown_name("link", link, self.tree.links, self.description.name)
        return self.tree.links[link]

    def _check_names(self) -> None:
        description = self.description
        named = [(each.joint, "motor") for each in description.motors]
        named += [(joint, "initial position") for joint, _ in description.initial_positions]
        named += [(joint, "friction") for joint, _ in description.joint_friction]
        for joint, what in named:
            if joint not in self._rate_of:
                raise unknown_name("joint", joint, self._rate_of, f"{description.name}: {what}")
        for link, _ in description.slides:
            self.link_place(link)


def orientation_of(quaternion: Sequence[float]) -> Rotation:
    """Convert MuJoCo's quaternion to an orientation (x, y, z, w)."""
    w, x, y, z = quaternion
    return x, y, z, w
