"""A body in PyBullet: indices of its joints and links by name, and what acts on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from messages.se3 import Pose3, Rotation, Vector
from services.runtime.errors import unknown_name
from services.sim.physics._pybullet import pybullet
from services.sim.physics.engine import load_urdf
from services.sim.physics.world import Body, BodyState, Inertia, JointFriction, JointReadings


@dataclass(frozen=True)
class BulletBody:
    """A body in a client: its number, the indices of its movable joints, motors and links (-1 for the root)."""

    client: int
    description: Body
    body_id: int
    joints: dict[str, int]
    motors: tuple[int, ...]
    max_torques: tuple[float, ...]
    links: dict[str, int]

    def joint_index(self, joint: str) -> int:
        """The index of a movable joint; raises BadInput with those that there are."""
        if joint not in self.joints:
            raise unknown_name("joint", joint, self.joints, self.description.name)
        return self.joints[joint]

    def joint_readings(self) -> JointReadings:
        """Angles, speeds and motor torques of the movable joints."""
        rows = pybullet.getJointStates(self.body_id, tuple(self.joints.values()), self.client)
        return JointReadings(
            tuple(row[0] for row in rows), tuple(row[1] for row in rows), tuple(row[3] for row in rows)
        )

    def set_efforts(self, efforts: Mapping[str, float]) -> None:
        """Put efforts on joints for one step."""
        indices = [self.joint_index(joint) for joint in efforts]
        pybullet.setJointMotorControlArray(
            self.body_id,
            indices,
            pybullet.TORQUE_CONTROL,
            forces=list(efforts.values()),
            physicsClientId=self.client,
        )

    def with_joint_friction(self, joint_friction: Mapping[str, JointFriction]) -> BulletBody:
        """Itself with joints that resist so.

        Damping is the engine's; dry friction is a motor that wants to stand still and has no more than its force.
        """
        for index, (damping, friction) in [(self.joint_index(joint), each) for joint, each in joint_friction.items()]:
            pybullet.changeDynamics(self.body_id, index, jointDamping=damping, physicsClientId=self.client)
            pybullet.setJointMotorControl2(
                self.body_id,
                index,
                pybullet.VELOCITY_CONTROL,
                targetVelocity=0.0,
                force=friction,
                physicsClientId=self.client,
            )
        every = {**dict(self.description.joint_friction), **joint_friction}
        return replace(self, description=replace(self.description, joint_friction=tuple(every.items())))

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Put joints at positions, at rest."""
        for index, position in [(self.joint_index(joint), position) for joint, position in positions.items()]:
            pybullet.resetJointState(self.body_id, index, position, 0.0, physicsClientId=self.client)

    def link_state(self, link: str) -> BodyState:
        """Pose of a link's frame, and how its origin moves."""
        if (index := self._link_index(link)) < 0:
            pose = pybullet.getBasePositionAndOrientation(self.body_id, self.client)
            return BodyState(*pose, *pybullet.getBaseVelocity(self.body_id, self.client))
        row = pybullet.getLinkState(
            self.body_id, index, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self.client
        )
        (cx, cy, cz), (x, y, z), (vx, vy, vz), (wx, wy, wz) = row[0], row[4], row[6], row[7]
        dx, dy, dz = x - cx, y - cy, z - cz  # PyBullet tells the velocity of the centre of mass
        linear = (vx + wy * dz - wz * dy, vy + wz * dx - wx * dz, vz + wx * dy - wy * dx)
        return BodyState(row[4], _normalized(row[5]), linear, row[7])

    def link_pose(self, link: str) -> Pose3:
        """Where the frame of a link is."""
        if (index := self._link_index(link)) < 0:
            return Pose3(*pybullet.getBasePositionAndOrientation(self.body_id, self.client))
        row = pybullet.getLinkState(self.body_id, index, computeForwardKinematics=1, physicsClientId=self.client)
        return Pose3(row[4], _normalized(row[5]))

    def inertia(self, link: str) -> Inertia:
        """What a link weighs and how."""
        mass, friction, moments, place, turn, *_ = pybullet.getDynamicsInfo(
            self.body_id, self._link_index(link), self.client
        )
        return Inertia(mass, Pose3(place, turn), moments, friction)

    def apply_wrench(self, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        """Act on a link for one step: a force [N] at a point of the world [m] and a torque [N m], in world axes."""
        index, frame = self._link_index(link), pybullet.WORLD_FRAME
        pybullet.applyExternalForce(self.body_id, index, force, point, frame, physicsClientId=self.client)
        pybullet.applyExternalTorque(self.body_id, index, torque, frame, physicsClientId=self.client)

    def _link_index(self, link: str) -> int:
        if link not in self.links:
            raise unknown_name("link", link, self.links, self.description.name)
        return self.links[link]


def load_bullet_body(client: int, body: Body) -> BulletBody:
    """Load a body at rest, as its record says; raises BadInput for a joint that it does not have."""
    body_id = load_urdf(client, body.urdf, body.pose, body.fixed)
    count = pybullet.getNumJoints(body_id, client)
    rows = [pybullet.getJointInfo(body_id, index, client) for index in range(count)]
    movable = {row[1].decode(): row[0] for row in rows if row[2] != pybullet.JOINT_FIXED}
    named = [(each.joint, "motor") for each in body.motors]
    named += [(joint, "initial position") for joint, _ in body.initial_positions] + [
        (joint, "friction") for joint, _ in body.joint_friction
    ]
    for joint, what in named:
        if joint not in movable:
            pybullet.removeBody(body_id, physicsClientId=client)
            raise unknown_name("joint", joint, movable, f"{body.name}: {what}")
    root = pybullet.getBodyInfo(body_id, client)[0].decode()
    loaded = BulletBody(
        client=client,
        description=body,
        body_id=body_id,
        joints=movable,
        motors=tuple(movable[motor.joint] for motor in body.motors),
        max_torques=tuple(motor.torque for motor in body.motors),
        links={root: -1} | {row[12].decode(): row[0] for row in rows},
    )
    loaded.set_joints(dict(body.initial_positions))
    return loaded.with_joint_friction(dict(body.joint_friction)) if body.joint_friction else loaded


def _normalized(turn: Rotation) -> Rotation:
    """Of length 1 again: PyBullet tells how links lie in single precision."""
    x, y, z, w = turn
    length = (x * x + y * y + z * z + w * w) ** 0.5
    return x / length, y / length, z / length, w / length
