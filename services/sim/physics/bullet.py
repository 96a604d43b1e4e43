"""The world in PyBullet, and the pictures of its software renderer, which needs neither display nor GPU."""

from __future__ import annotations

import math
from collections.abc import Mapping
from math import inf
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, rotated_axes
from models.world import WorldDescription
from services.runtime.errors import BadInput, unknown_name
from services.sim.physics._pybullet import pybullet
from services.sim.physics.bullet_body import BulletBody
from services.sim.physics.collision import CollisionChecker
from services.sim.physics.engine import configure, connect, load_world
from services.sim.physics.world import (
    Body,
    BodyState,
    CameraModel,
    Configuration,
    Contact,
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

    def body(self, name: str) -> BulletBody:
        if (body := self._bodies.get(name)) is None:
            raise unknown_name("body", name, self._bodies)
        return body

    def spawn(self, body: Body) -> BulletBody:
        """Add a body; raises BadInput for a taken name, an overlap, or a URDF without a motor's joint."""
        if body.name in self._bodies:
            raise BadInput(f"a body named {body.name!r} is already in the world; delete it first")
        if body.name in self._obstacles.values():
            raise BadInput(f"{body.name!r} is an obstacle of this world; take another name")
        self._collision_checker.add(body, self._configurations())
        added = BulletBody(self._client, body)
        try:
            _load(added)
        except BadInput:
            self._collision_checker.remove(body.name)
            raise
        self._bodies[body.name] = added
        return added

    def delete(self, name: str) -> None:
        """Take a body out."""
        pybullet.removeBody(self.body(name).body_id, physicsClientId=self._client)
        self._collision_checker.remove(name)
        del self._bodies[name]

    def reset(self) -> None:
        """Empty the client and load everything in the order of its spawning: bit for bit a fresh start."""
        pybullet.resetSimulation(physicsClientId=self._client)
        configure(self._client, self._step_ns / SECOND)
        self._obstacles = load_world(self._client, self.description)
        for body in self._bodies.values():
            _load(body)

    def step(self) -> None:
        """Advance by ``step_ns``."""
        pybullet.stepSimulation(self._client)

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body; raises BadInput where it would overlap."""
        body, pose = self.body(name), Pose3(state.position, state.orientation)
        self._check(name, Configuration(pose, body.configuration.joints))
        body.place(pose)
        body.set_velocity(state.linear, state.angular)

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Put joints at positions, at rest; raises BadInput where the body would overlap then."""
        body = self.body(name)
        pose, joints = body.configuration
        for joint in positions:
            body.joint_index(joint)
        self._check(name, Configuration(pose, {**joints, **positions}))
        body.set_joints(positions)

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

    def _check(self, name: str, configuration: Configuration) -> None:
        others = {other: where for other, where in self._configurations().items() if other != name}
        self._collision_checker.check(name, configuration, others)

    def _configurations(self) -> dict[str, Configuration]:
        return {name: body.configuration for name, body in self._bodies.items()}


def _load(body: BulletBody) -> None:
    body.load()
    body.set_speeds((0.0,) * len(body.max_torques))


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
