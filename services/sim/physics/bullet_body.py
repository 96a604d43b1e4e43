"""A body in PyBullet: its joints and links by name, and the forces on them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from messages.se3 import IDENTITY, Pose3, Rotation, Vector, add_cross, rotate, rotate_inverse
from models.urdf import parse_urdf, read_urdf
from services.runtime.errors import unknown_name
from services.sim.physics._pybullet import pybullet
from services.sim.physics.engine import load_urdf
from services.sim.physics.inertia import principal_inertia
from services.sim.physics.world import (
    SLIDING_SHARE,
    Body,
    BodyState,
    Configuration,
    Inertia,
    JointFriction,
    JointReadings,
    MotorTarget,
)

NO_JOINTS = JointReadings((), (), ())


class BulletBody:
    """Implements ``BodyHandle``, and what the world needs of a body: its number, and the indices of its motors."""

    def __init__(self, client: int, description: Body) -> None:
        self.description, self.body_id = description, -1
        self.max_torques = tuple(motor.torque for motor in description.motors)
        self._client = client
        self.limited_damping: dict[str, float] = {}
        self._joints: dict[str, int] = {}
        self._motors: tuple[int, ...] = ()
        self._joint_indices: tuple[int, ...] = ()
        self._links: dict[str, int] = {}
        """Indices of links; the root's is -1."""
        self._centre: Pose3 | None = None
        """The pose of the root's principal axes of inertia in its frame; None if both coincide."""

    def load(self) -> None:
        """Load the body into a new or reset client, at rest; raises BadInput if it lacks a joint that is named."""
        client, description = self._client, self.description
        self.body_id = load_urdf(client, description.urdf, description.pose, description.fixed)
        # PyBullet reads and sets the pose of the root's principal axes of inertia, not of its frame.
        centre = Pose3(*pybullet.getDynamicsInfo(self.body_id, -1, client)[3:5])
        self._centre = None if centre == IDENTITY else centre
        count = pybullet.getNumJoints(self.body_id, client)
        rows = [pybullet.getJointInfo(self.body_id, index, client) for index in range(count)]
        self._joints = {row[1].decode(): row[0] for row in rows if row[2] != pybullet.JOINT_FIXED}
        self._joint_indices = tuple(self._joints.values())
        self._set_damping({row[1].decode(): row[6] for row in rows if row[6] > 0})
        named = [(each.joint, "motor") for each in description.motors]
        named += [(joint, "initial position") for joint, _ in description.initial_positions]
        named += [(joint, "friction") for joint, _ in description.joint_friction]
        for joint, what in named:
            if joint not in self._joints:
                pybullet.removeBody(self.body_id, physicsClientId=client)
                raise unknown_name("joint", joint, self._joints, f"{description.name}: {what}")
        root = pybullet.getBodyInfo(self.body_id, client)[0].decode()
        self._motors = tuple(self._joints[motor.joint] for motor in description.motors)
        self._links = {root: -1} | {row[12].decode(): row[0] for row in rows}
        if description.slides:
            # By default friction acts along two axes of the world, each limited separately: shares along a link's axes
            # fail where both coincide.
            pybullet.setPhysicsEngineParameter(enableConeFriction=0, physicsClientId=client)
        for link, axis in description.slides:
            index = self._link_index(link)
            # The engine expects them in the principal axes of the link's inertia.
            along = rotate_inverse(pybullet.getDynamicsInfo(self.body_id, index, client)[4], axis)
            shares = [1 - (1 - SLIDING_SHARE) * each * each for each in along]
            pybullet.changeDynamics(self.body_id, index, anisotropicFriction=shares, physicsClientId=client)
        self.set_joints(dict(description.initial_positions))
        if description.joint_friction:
            self.set_joint_friction(dict(description.joint_friction))

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(self._joints)

    @property
    def links(self) -> tuple[str, ...]:
        return tuple(self._links)

    @property
    def motor_joints(self) -> tuple[str, ...]:
        return tuple(motor.joint for motor in self.description.motors)

    @property
    def configuration(self) -> Configuration:
        """The current root pose and joint positions."""
        return Configuration(self._root_pose(), dict(zip(self._joints, self.joint_readings().position, strict=True)))

    def state(self) -> BodyState:
        linear, angular = pybullet.getBaseVelocity(self.body_id, self._client)
        pose = self._root_pose()
        if self._centre is not None:
            linear = _velocity_at(linear, angular, rotate(pose.orientation, self._centre.position), -1.0)
        return BodyState(*pose, linear, angular)

    def place(self, pose: Pose3) -> None:
        """Set the pose of the root frame, without a check."""
        if self._centre is not None:
            pose = pose @ self._centre
        pybullet.resetBasePositionAndOrientation(self.body_id, *pose, physicsClientId=self._client)

    def set_velocity(self, linear: Vector, angular: Vector) -> None:
        if self._centre is not None:
            linear = _velocity_at(linear, angular, rotate(self._root_pose().orientation, self._centre.position), 1.0)
        pybullet.resetBaseVelocity(self.body_id, linear, angular, physicsClientId=self._client)

    def set_speeds(self, speeds: Sequence[float]) -> None:
        pybullet.setJointMotorControlArray(
            self.body_id,
            self._motors,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=speeds,
            forces=self.max_torques,
            physicsClientId=self._client,
        )

    def set_torques(self, torques: Sequence[float]) -> None:
        motors, client = (self.body_id, self._motors), self._client
        idle = [0.0] * len(self._motors)
        pybullet.setJointMotorControlArray(*motors, pybullet.VELOCITY_CONTROL, forces=idle, physicsClientId=client)
        pybullet.setJointMotorControlArray(*motors, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=client)

    def joint_index(self, joint: str) -> int:
        """Return the index of a movable joint; raises BadInput with those available."""
        if joint not in self._joints:
            raise unknown_name("joint", joint, self._joints, self.description.name)
        return self._joints[joint]

    def joint_readings(self) -> JointReadings:
        rows = pybullet.getJointStates(self.body_id, self._joint_indices, self._client)
        if not rows:
            return NO_JOINTS
        positions, velocities, _, torques = zip(*rows, strict=True)
        return JointReadings(positions, velocities, torques)

    def set_efforts(self, efforts: Mapping[str, float]) -> None:
        indices = [self.joint_index(joint) for joint in efforts]
        pybullet.setJointMotorControlArray(
            self.body_id,
            indices,
            pybullet.TORQUE_CONTROL,
            forces=list(efforts.values()),
            physicsClientId=self._client,
        )

    def drive_joints(self, targets: Mapping[str, MotorTarget]) -> None:
        pybullet.setJointMotorControlArray(
            self.body_id,
            [self.joint_index(joint) for joint in targets],
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[each.velocity for each in targets.values()],
            forces=[each.effort for each in targets.values()],
            physicsClientId=self._client,
        )

    def release_joints(self, joints: Sequence[str]) -> None:
        friction = dict(self.description.joint_friction)
        self.drive_joints({joint: MotorTarget(0.0, friction.get(joint, JointFriction()).friction) for joint in joints})

    def joint_inertias(self) -> tuple[float, ...]:
        matrix = pybullet.calculateMassMatrix(
            self.body_id, self.joint_readings().position, physicsClientId=self._client
        )
        first = len(matrix) - len(self._joints)  # the rows of a free root come first
        return tuple(matrix[first + index][first + index] for index in range(len(self._joints)))

    def set_joint_friction(self, joint_friction: Mapping[str, JointFriction]) -> None:
        # Damping is the engine's; dry friction is a motor with a target speed of 0 and its force as the limit.
        self._set_damping({joint: each.damping for joint, each in joint_friction.items()})
        for index, (_, friction) in [(self.joint_index(joint), each) for joint, each in joint_friction.items()]:
            pybullet.setJointMotorControl2(
                self.body_id,
                index,
                pybullet.VELOCITY_CONTROL,
                targetVelocity=0.0,
                force=friction,
                physicsClientId=self._client,
            )
        every = {**dict(self.description.joint_friction), **joint_friction}
        self.description = replace(self.description, joint_friction=tuple(every.items()))

    def _set_damping(self, damping: Mapping[str, float]) -> None:
        """Set the damping of joints, each limited so that a step does not reverse its motion."""
        most = self._largest_damping() if any(damping.values()) else dict.fromkeys(damping, math.inf)
        for joint, value in damping.items():
            self.limited_damping.pop(joint, None)
            if value > most[joint]:
                self.limited_damping[joint] = most[joint]
            index = self.joint_index(joint)
            pybullet.changeDynamics(
                self.body_id, index, jointDamping=min(value, most[joint]), physicsClientId=self._client
            )

    def _largest_damping(self) -> dict[str, float]:
        """Return the damping [N m s/rad or N s/m] that brings each joint to rest in one step: I / dt.

        The engine integrates damping explicitly: with twice as much, it drives the joint. I = 1 / (M^-1)_ii is the
        inertia of the joint while all others are free. With several joints, it changes with their positions, so half of
        it counts.
        """
        step = pybullet.getPhysicsEngineParameters(self._client)["fixedTimeStep"]
        rows = pybullet.getJointStates(self.body_id, self._joint_indices, self._client) or ()  # None for none
        matrix = pybullet.calculateMassMatrix(self.body_id, [row[0] for row in rows], physicsClientId=self._client)
        inertias = 1 / np.diag(np.linalg.pinv(np.array(matrix), hermitian=True))[-len(self._joints) :]
        share = 1.0 if len(self._joints) == 1 else 0.5
        return dict(zip(self._joints, (share * inertias / step).tolist(), strict=True))

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Set joint positions, at rest, without a check."""
        for index, position in [(self.joint_index(joint), position) for joint, position in positions.items()]:
            pybullet.resetJointState(self.body_id, index, position, 0.0, physicsClientId=self._client)

    def link_state(self, link: str) -> BodyState:
        return self.link_states([link])[0]

    def link_states(self, links: Sequence[str]) -> list[BodyState]:
        """Return the states of several links, in little more time than one takes."""
        indices = [self._link_index(link) for link in links]
        below = [index for index in indices if index >= 0]
        rows: Iterator[Any] = iter(
            pybullet.getLinkStates(
                self.body_id, below, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self._client
            )
            if below
            else ()
        )
        return [self.state() if index < 0 else _link_state(next(rows)) for index in indices]

    def link_pose(self, link: str) -> Pose3:
        if (index := self._link_index(link)) < 0:
            return self._root_pose()
        row = pybullet.getLinkState(self.body_id, index, computeForwardKinematics=1, physicsClientId=self._client)
        return Pose3(row[4], _normalized(row[5]))

    def inertia(self, link: str) -> Inertia:
        index = self._link_index(link)
        mass, friction, moments, position, orientation, *_ = pybullet.getDynamicsInfo(self.body_id, index, self._client)
        if index < 0 and self.description.fixed:
            # PyBullet gives a fixed root no mass.
            robot = parse_urdf(read_urdf(self.description.urdf))
            return principal_inertia(next(each for each in robot.links if each.name == link).inertia, friction)
        return Inertia(mass, Pose3(position, orientation), moments, friction)

    def apply_wrench(self, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        index, frame = self._link_index(link), pybullet.WORLD_FRAME
        pybullet.applyExternalForce(self.body_id, index, force, point, frame, physicsClientId=self._client)
        pybullet.applyExternalTorque(self.body_id, index, torque, frame, physicsClientId=self._client)

    def _root_pose(self) -> Pose3:
        pose = Pose3(*pybullet.getBasePositionAndOrientation(self.body_id, self._client))
        return pose if self._centre is None else pose @ self._centre.inverse()

    def _link_index(self, link: str) -> int:
        if link not in self._links:
            raise unknown_name("link", link, self._links, self.description.name)
        return self._links[link]


def _link_state(row: Any) -> BodyState:
    (cx, cy, cz), (x, y, z) = row[0], row[4]
    # PyBullet gives the velocity of the centre of mass.
    linear = _velocity_at(row[6], row[7], (x - cx, y - cy, z - cz), 1.0)
    return BodyState(row[4], _normalized(row[5]), linear, row[7])


def _velocity_at(linear: Vector, angular: Vector, offset: Vector, sign: float) -> Vector:
    """Return the velocity of the point at ``sign`` * ``offset`` from one that moves like this: v + w x r."""
    x, y, z = offset
    return add_cross(linear, angular, (sign * x, sign * y, sign * z))


def _normalized(orientation: Rotation) -> Rotation:
    """Normalise an orientation: PyBullet returns those of links in single precision."""
    x, y, z, w = orientation
    length = (x * x + y * y + z * z + w * w) ** 0.5
    return x / length, y / length, z / length, w / length
