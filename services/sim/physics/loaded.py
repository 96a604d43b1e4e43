"""A body in PyBullet: the numbers behind its names, and what is done to its joints and links by them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from services.runtime.errors import unknown
from services.sim.physics.engine import load_body
from services.sim.physics.quiet import pybullet
from services.sim.physics.world import Body, BodyState, Inertia, JointReadings, Placement, Resistance, Rotation, Vector


@dataclass(frozen=True)
class Loaded:
    """A body in a client: its number, the indices of its movable joints, motors and links (-1 for the root)."""

    client: int
    body: Body
    number: int
    joints: dict[str, int]
    motors: tuple[int, ...]
    torques: tuple[float, ...]
    links: dict[str, int]

    def index(self, joint: str) -> int:
        """The index of a movable joint; raises BadInput with those that there are."""
        if joint not in self.joints:
            raise unknown("joint", joint, self.joints, self.body.name)
        return self.joints[joint]

    def readings(self) -> JointReadings:
        """Angles, speeds and motor torques of the movable joints."""
        rows = pybullet.getJointStates(self.number, tuple(self.joints.values()), self.client)
        return JointReadings(
            tuple(row[0] for row in rows), tuple(row[1] for row in rows), tuple(row[3] for row in rows)
        )

    def set_efforts(self, efforts: Mapping[str, float]) -> None:
        """Put efforts on joints for one step."""
        indices = [self.index(joint) for joint in efforts]
        pybullet.setJointMotorControlArray(
            self.number,
            indices,
            pybullet.TORQUE_CONTROL,
            forces=list(efforts.values()),
            physicsClientId=self.client,
        )

    def resisting(self, resistance: Mapping[str, Resistance]) -> Loaded:
        """Itself with joints that resist so.

        Damping is the engine's; dry friction is a motor that wants to stand still and has no more than its force.
        """
        for index, (damping, friction) in [(self.index(joint), each) for joint, each in resistance.items()]:
            pybullet.changeDynamics(self.number, index, jointDamping=damping, physicsClientId=self.client)
            pybullet.setJointMotorControl2(
                self.number,
                index,
                pybullet.VELOCITY_CONTROL,
                targetVelocity=0.0,
                force=friction,
                physicsClientId=self.client,
            )
        every = {**dict(self.body.resistance), **resistance}
        return replace(self, body=replace(self.body, resistance=tuple(every.items())))

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Put joints at positions, at rest."""
        for index, position in [(self.index(joint), position) for joint, position in positions.items()]:
            pybullet.resetJointState(self.number, index, position, 0.0, physicsClientId=self.client)

    def link_state(self, link: str) -> BodyState:
        """Pose of a link's frame, and how its origin moves."""
        if (index := self._link(link)) < 0:
            pose = pybullet.getBasePositionAndOrientation(self.number, self.client)
            return BodyState(*pose, *pybullet.getBaseVelocity(self.number, self.client))
        row = pybullet.getLinkState(
            self.number, index, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self.client
        )
        (cx, cy, cz), (x, y, z), (vx, vy, vz), (wx, wy, wz) = row[0], row[4], row[6], row[7]
        dx, dy, dz = x - cx, y - cy, z - cz  # PyBullet tells the velocity of the centre of mass
        linear = (vx + wy * dz - wz * dy, vy + wz * dx - wx * dz, vz + wx * dy - wy * dx)
        return BodyState(row[4], _unit(row[5]), linear, row[7])

    def link_placement(self, link: str) -> Placement:
        """Where the frame of a link is."""
        if (index := self._link(link)) < 0:
            return Placement(*pybullet.getBasePositionAndOrientation(self.number, self.client))
        row = pybullet.getLinkState(self.number, index, computeForwardKinematics=1, physicsClientId=self.client)
        return Placement(row[4], _unit(row[5]))

    def inertia(self, link: str) -> Inertia:
        """What a link weighs and how."""
        mass, friction, moments, place, turn, *_ = pybullet.getDynamicsInfo(self.number, self._link(link), self.client)
        return Inertia(mass, Placement(place, turn), moments, friction)

    def push(self, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        """Act on a link for one step: a force [N] at a point of the world [m] and a torque [N m], in world axes."""
        index, frame = self._link(link), pybullet.WORLD_FRAME
        pybullet.applyExternalForce(self.number, index, force, point, frame, physicsClientId=self.client)
        pybullet.applyExternalTorque(self.number, index, torque, frame, physicsClientId=self.client)

    def _link(self, link: str) -> int:
        if link not in self.links:
            raise unknown("link", link, self.links, self.body.name)
        return self.links[link]


def load(client: int, body: Body) -> Loaded:
    """Load a body at rest, as its record says; raises BadInput for a joint that it does not have."""
    number = load_body(client, body.urdf, body.placement, body.fixed)
    count = pybullet.getNumJoints(number, client)
    rows = [pybullet.getJointInfo(number, index, client) for index in range(count)]
    movable = {row[1].decode(): row[0] for row in rows if row[2] != pybullet.JOINT_FIXED}
    named = [(each.joint, "motor") for each in body.motors]
    named += [(joint, "start") for joint, _ in body.start] + [(joint, "resistance") for joint, _ in body.resistance]
    for joint, what in named:
        if joint not in movable:
            pybullet.removeBody(number, physicsClientId=client)
            raise unknown("joint", joint, movable, f"{body.name}: {what}")
    root = pybullet.getBodyInfo(number, client)[0].decode()
    loaded = Loaded(
        client=client,
        body=body,
        number=number,
        joints=movable,
        motors=tuple(movable[motor.joint] for motor in body.motors),
        torques=tuple(motor.torque for motor in body.motors),
        links={root: -1} | {row[12].decode(): row[0] for row in rows},
    )
    loaded.set_joints(dict(body.start))
    return loaded.resisting(dict(body.resistance)) if body.resistance else loaded


def _unit(turn: Rotation) -> Rotation:
    """Of length 1 again: PyBullet tells how links lie in single precision."""
    x, y, z, w = turn
    length = (x * x + y * y + z * z + w * w) ** 0.5
    return x / length, y / length, z / length, w / length
