"""The world in PyBullet, and the pictures of its software renderer, which needs neither display nor GPU."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from math import inf
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, Vector, rotated_axes
from models.world import WorldDescription
from services.runtime.errors import BadInput, unknown_name
from services.sim.physics._pybullet import pybullet
from services.sim.physics.bullet_body import BulletBody, load_bullet_body
from services.sim.physics.collision import CollisionChecker
from services.sim.physics.engine import configure, connect, load_world
from services.sim.physics.world import (
    Body,
    BodyState,
    CameraModel,
    Configuration,
    Contact,
    Inertia,
    JointFriction,
    JointReadings,
)

SECOND = 1_000_000_000


class BulletWorld:
    """Implements ``World``. Opened by ``with``; bodies, obstacles and ground follow ``description``.

    Bodies are kept in the order of their spawning, since PyBullet's numbers depend on it: two robots swapped differ by
    7e-6 m after 4 s.
    """

    def __init__(self, description: WorldDescription, step_ns: int) -> None:
        self.description, self._step_ns = description, step_ns
        self._bodies: dict[str, BulletBody] = {}

    def __enter__(self) -> Self:
        self._client = connect(self._step_ns / SECOND)
        self._obstacles = load_world(self._client, self.description)
        self._collision_checker = CollisionChecker(self.description)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def step_ns(self) -> int:
        """Simulation time of one step, ns."""
        return self._step_ns

    @property
    def names(self) -> tuple[str, ...]:
        """All bodies, in the order of their spawning."""
        return tuple(self._bodies)

    def spawn(self, body: Body) -> None:
        """Add a body; raises BadInput for a taken name, an overlap, or a URDF without a motor's joint."""
        if body.name in self._bodies:
            raise BadInput(f"a body named {body.name!r} is already in the world; delete it first")
        if body.name in self._obstacles.values():
            raise BadInput(f"{body.name!r} is an obstacle of this world; take another name")
        self._collision_checker.add(body, self._configurations())
        try:
            self._bodies[body.name] = self._load(body)
        except BadInput:
            self._collision_checker.remove(body.name)
            raise

    def delete(self, name: str) -> None:
        """Take a body out."""
        pybullet.removeBody(self._find(name).body_id, physicsClientId=self._client)
        self._collision_checker.remove(name)
        del self._bodies[name]

    def reset(self) -> None:
        """Empty the client and load everything in the order of its spawning: bit for bit a fresh start."""
        pybullet.resetSimulation(physicsClientId=self._client)
        configure(self._client, self._step_ns / SECOND)
        self._obstacles = load_world(self._client, self.description)
        self._bodies = {name: self._load(loaded.description) for name, loaded in self._bodies.items()}

    def step(self) -> None:
        """Advance by ``step_ns``."""
        pybullet.stepSimulation(self._client)

    def state(self, name: str) -> BodyState:
        """Pose and velocity of a body's root frame; about 6 us."""
        number = self._find(name).body_id
        pose = pybullet.getBasePositionAndOrientation(number, self._client)
        return BodyState(*pose, *pybullet.getBaseVelocity(number, self._client))

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body; raises BadInput where it would overlap."""
        loaded = self._find(name)
        number, pose = loaded.body_id, Pose3(state.position, state.orientation)
        others = {other: where for other, where in self._configurations().items() if other != name}
        self._collision_checker.check(name, Configuration(pose, self._configuration(loaded).joints), others)
        pybullet.resetBasePositionAndOrientation(number, *pose, physicsClientId=self._client)
        pybullet.resetBaseVelocity(number, state.linear, state.angular, physicsClientId=self._client)

    def joints(self, name: str) -> tuple[str, ...]:
        """The movable joints of a body, in the URDF's order."""
        return tuple(self._find(name).joints)

    def joint_readings(self, name: str) -> JointReadings:
        """Angles, speeds and motor torques of the movable joints."""
        return self._find(name).joint_readings()

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Put joints at positions, at rest; raises BadInput where the body would overlap then."""
        loaded = self._find(name)
        configuration = self._configuration(loaded)
        for joint in positions:
            loaded.joint_index(joint)
        others = {other: where for other, where in self._configurations().items() if other != name}
        self._collision_checker.check(
            name, Configuration(configuration.pose, {**configuration.joints, **positions}), others
        )
        loaded.set_joints(positions)

    def set_efforts(self, name: str, efforts: Mapping[str, float]) -> None:
        """Put efforts on joints for one step; 4 us for one joint."""
        self._find(name).set_efforts(efforts)

    def set_joint_friction(self, name: str, joint_friction: Mapping[str, JointFriction]) -> None:
        """Let joints resist so from now on, also after a reset."""
        self._bodies[name] = self._find(name).with_joint_friction(joint_friction)

    def apply_wrench(self, name: str, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        """Act on a link for one step."""
        self._find(name).apply_wrench(link, force, torque, point)

    def set_speeds(self, name: str, speeds: Sequence[float]) -> None:
        """Set the target speeds [rad/s] of a body's motors."""
        loaded = self._find(name)
        pybullet.setJointMotorControlArray(
            loaded.body_id,
            loaded.motors,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=speeds,
            forces=loaded.max_torques,
            physicsClientId=self._client,
        )

    def set_torques(self, name: str, torques: Sequence[float]) -> None:
        """Let a body's motors give these torques [N m] for one step."""
        loaded, client = self._find(name), self._client
        arms = loaded.body_id, loaded.motors
        idle = [0.0] * len(loaded.motors)
        pybullet.setJointMotorControlArray(*arms, pybullet.VELOCITY_CONTROL, forces=idle, physicsClientId=client)
        pybullet.setJointMotorControlArray(*arms, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=client)

    def link_pose(self, name: str, link: str) -> Pose3:
        """Where the frame of a link is."""
        return self._find(name).link_pose(link)

    def links(self, name: str) -> tuple[str, ...]:
        """The links of a body, its root first."""
        return tuple(self._find(name).links)

    def link_state(self, name: str, link: str) -> BodyState:
        """Pose of a link's frame, and how its origin moves."""
        return self._find(name).link_state(link)

    def inertia(self, name: str, link: str) -> Inertia:
        """What a link weighs and how."""
        return self._find(name).inertia(link)

    def contacts(self) -> tuple[Contact, ...]:
        """The pairs that touched in the last step."""
        named = {loaded.body_id: name for name, loaded in self._bodies.items()}
        everything = self._obstacles | named
        pairs = set()
        for point in pybullet.getContactPoints(physicsClientId=self._client):
            one, other = point[1], point[2]
            # Bullet lists what comes near, too; a touch has depth or transmits a force.
            if one in everything and other in everything and (point[8] <= 0 or point[9] > 0):
                first, second = sorted((everything[one], everything[other]))
                pairs.add(Contact(first, second) if first in self._bodies else Contact(second, first))
        return tuple(sorted(pairs))

    def cast_rays(self, origins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far rays get, as a fraction of their length; inf where nothing is hit. 360 rays take about 1 ms."""
        hits = pybullet.rayTestBatch(origins, ends, physicsClientId=self._client)
        return np.fromiter((hit[2] if hit[0] >= 0 else inf for hit in hits), np.float64, len(hits))

    def render(self, eye: Pose3, camera: CameraModel) -> bytes:
        """A picture, drawn in software: 320 by 240 pixels take about 30 ms."""
        return render_image(self._client, eye, camera)

    def close(self) -> None:
        """End both clients."""
        self._collision_checker.close()
        pybullet.disconnect(physicsClientId=self._client)

    def _find(self, name: str) -> BulletBody:
        if (loaded := self._bodies.get(name)) is None:
            raise unknown_name("body", name, self._bodies)
        return loaded

    def _configurations(self) -> dict[str, Configuration]:
        return {name: self._configuration(loaded) for name, loaded in self._bodies.items()}

    def _configuration(self, loaded: BulletBody) -> Configuration:
        pose = Pose3(*pybullet.getBasePositionAndOrientation(loaded.body_id, self._client))
        return Configuration(pose, dict(zip(loaded.joints, loaded.joint_readings().position, strict=True)))

    def _load(self, body: Body) -> BulletBody:
        loaded = self._bodies[body.name] = load_bullet_body(self._client, body)
        self.set_speeds(body.name, (0.0,) * len(body.motors))
        return loaded


def render_image(client: int, eye: Pose3, camera: CameraModel) -> bytes:
    """The picture seen from ``eye`` (z forward, x right, y down): rows from the top, three bytes RGB per pixel."""
    axes = np.array(rotated_axes(eye.orientation)).T
    position = np.array(eye.position)
    view = pybullet.computeViewMatrix(
        position.tolist(), (position + axes[:, 2]).tolist(), (-axes[:, 1]).tolist(), physicsClientId=client
    )
    aspect = camera.width / camera.height
    upright = 2 * math.atan(math.tan(camera.fov / 2) / aspect)
    projection = pybullet.computeProjectionMatrixFOV(
        math.degrees(upright), aspect, camera.near, camera.far, physicsClientId=client
    )
    image = pybullet.getCameraImage(
        camera.width,
        camera.height,
        view,
        projection,
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
        physicsClientId=client,
    )
    pixels = np.asarray(image[2], np.uint8).reshape(camera.height, camera.width, 4)
    return pixels[:, :, :3].tobytes()
