"""The world in PyBullet, with images from its software renderer, which needs neither display nor GPU."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from math import inf
from operator import itemgetter
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from messages.se3 import IDENTITY, Pose3, rotated_axes
from models.bodies import Light
from models.world import WorldDescription
from services.runtime.errors import BadInput, unknown_name
from services.sim.physics._pybullet import pybullet
from services.sim.physics.bullet_body import BulletBody
from services.sim.physics.collision import CollisionChecker
from services.sim.physics.engine import configure, connect, disconnect, load_world
from services.sim.physics.world import (
    MIN_STANDING_NORMAL,
    Body,
    BodyState,
    CameraModel,
    Configuration,
    Contact,
    ground_samples,
)
from services.sim.physics.world_bodies import ground_height

SECOND = 1_000_000_000

MAX_RAYS = 16_000
"""Maximum number of rays that the engine casts in one call."""


class BulletWorld:
    """Implements ``World``. Opened by ``with``; bodies, obstacles and ground come from ``description``.

    Bodies are kept in the order of their spawning, since PyBullet's results depend on it: two robots swapped differ by
    7e-6 m after 4 s.
    """

    def __init__(self, description: WorldDescription, step_ns: int) -> None:
        self.description, self._step_ns = description, step_ns
        self._bodies: dict[str, BulletBody] = {}

    def __enter__(self) -> Self:
        self._client = connect(self._step_ns / SECOND)
        self._load_world()
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
        """Names of all spawned bodies, in the order of their spawning."""
        return tuple(self._bodies)

    def body(self, name: str) -> BulletBody:
        if (body := self._bodies.get(name)) is None:
            raise unknown_name("body", name, self._bodies)
        return body

    @property
    def world_bodies(self) -> tuple[str, ...]:
        """Names of the world's movable and moving bodies."""
        return tuple(self._world.handles)

    def world_body_state(self, name: str) -> BodyState:
        if (handle := self._world.handles.get(name)) is None:
            raise unknown_name("movable body", name, self._world.handles)
        return handle.state()

    def overlaps_at_start(self) -> tuple[str, ...]:
        """Return the movable bodies that the world's file places inside others; the first step throws them out."""
        return self._collision_checker.overlaps_at_start()

    def ground_height(self, x: float, y: float, radius: float) -> float:
        """Return the highest ground within ``radius`` of a point, m: of ramps, height maps and floors, or 0."""
        grounds, highest = self._world.grounds, 0.0
        if grounds:
            for point in ground_samples(x, y, radius):
                highest = max(highest, ground_height(self._client, grounds, *point) or 0.0)
        return highest

    def spawn(self, body: Body) -> BulletBody:
        """Add a body; raises BadInput for a taken name, an overlap, or a URDF that lacks a motor's joint."""
        if body.name in self._bodies:
            raise BadInput(f"a body named {body.name!r} is already in the world; delete it first")
        if body.name in self._world.names.values():
            raise BadInput(f"{body.name!r} is an obstacle of this world; take another name")
        self._collision_checker.add(body, self._configurations(), self._places())
        added = BulletBody(self._client, body)
        try:
            _load(added)
        except BadInput:
            self._collision_checker.remove(body.name)
            raise
        self._bodies[body.name] = added
        return added

    def delete(self, name: str) -> None:
        """Delete a body."""
        pybullet.removeBody(self.body(name).body_id, physicsClientId=self._client)
        self._collision_checker.remove(name)
        del self._bodies[name]

    def reset(self) -> None:
        """Empty the client and load everything again in the order of spawning: bit for bit a fresh start."""
        pybullet.resetSimulation(physicsClientId=self._client)
        configure(self._client, self._step_ns / SECOND)
        self._load_world()
        for body in self._bodies.values():
            _load(body)

    def step(self) -> None:
        """Advance by ``step_ns``."""
        seconds = self._step_ns / SECOND
        for handle in self._moving:
            handle.follow_path(self._steps * seconds, seconds)
        self._steps += 1
        pybullet.stepSimulation(self._client)

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body, or a movable one of the world; raises BadInput if it would overlap."""
        pose = Pose3(state.position, state.orientation)
        if name in self._world.handles:
            self._set_world_body_state(name, state)
            return
        body = self.body(name)
        self._check(name, Configuration(pose, body.configuration.joints))
        body.place(pose)
        body.set_velocity(state.linear, state.angular)

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Set joint positions, at rest; raises BadInput if the body would then overlap."""
        body = self.body(name)
        pose, joints = body.configuration
        for joint in positions:
            body.joint_index(joint)
        self._check(name, Configuration(pose, {**joints, **positions}))
        body.set_joints(positions)

    def states(self) -> NDArray[np.float64]:
        return np.array([body.state().numbers for body in self._bodies.values()]).reshape(-1, 13)

    def joint_readings(self) -> NDArray[np.float64]:
        readings = [np.array(body.joint_readings()) for body in self._bodies.values()]
        return np.concatenate((np.empty((3, 0)), *readings), axis=1)

    def link_poses(self, links: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        poses = [self.body(body).link_pose(link) for body, link in links]
        return np.array([(*each.position, *each.orientation) for each in poses]).reshape(-1, 7)

    def link_states(self, links: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        rows = [
            each.numbers
            for body, own in groupby(links, itemgetter(0))
            for each in self.body(body).link_states([link for _, link in own])
        ]
        return np.array(rows).reshape(-1, 13)

    def contacts(self) -> tuple[Contact, ...]:
        """Return the pairs that touched in the last step; standing on a ramp, for example, does not count."""
        grounds = self._world.grounds
        named = {loaded.body_id: name for name, loaded in self._bodies.items()}
        everything = self._world.names | named
        pairs = set()
        for point in pybullet.getContactPoints(physicsClientId=self._client):
            one, other = point[1], point[2]
            # Bullet also lists near misses; a contact has depth or transmits a force.
            if one in everything and other in everything and (point[8] <= 0 or point[9] > 0):
                if abs(point[7][2]) > MIN_STANDING_NORMAL and not grounds.isdisjoint((one, other)):
                    continue
                first, second = sorted((everything[one], everything[other]))
                if first in self._bodies:
                    pairs.add(Contact(first, second))
                elif second in self._bodies:
                    pairs.add(Contact(second, first))
        return tuple(sorted(pairs))

    def cast_rays(self, origins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cast rays; return the distance to the first hit as a fraction of each ray's length, inf without a hit.

        360 rays take about 1 ms.
        """
        fractions = np.empty(len(origins))
        for first in range(0, len(origins), MAX_RAYS):
            part = slice(first, first + MAX_RAYS)
            hits = pybullet.rayTestBatch(origins[part], ends[part], physicsClientId=self._client)
            fractions[part] = [hit[2] if hit[0] >= 0 else inf for hit in hits]
        return fractions

    def cast_fans(
        self, links: Sequence[tuple[str, str]], mount: Pose3, rays: NDArray[np.float64], near: float, far: float
    ) -> NDArray[np.float64]:
        """Cast the rays of identical sensors; the 360 rays of one take about 1 ms."""
        poses = [self.body(body).link_pose(link) for body, link in links]
        eyes = poses if mount == IDENTITY else [pose @ mount for pose in poses]
        turned = rays @ np.array([rotated_axes(each.orientation) for each in eyes])
        origins = np.array([each.position for each in eyes])[:, None, :]
        starts, ends = origins + near * turned, origins + far * turned
        fractions = self.cast_rays(starts.reshape(-1, 3), ends.reshape(-1, 3)).reshape(len(eyes), len(rays))
        return near + (far - near) * fractions

    def render(self, eye: Pose3, camera: CameraModel) -> bytes:
        """Render an image in software: 320 by 240 pixels take about 30 ms."""
        return render_image(self._client, eye, camera, self.description.lights[:1])

    def close(self) -> None:
        """Close both clients."""
        self._collision_checker.close()
        disconnect(self._client, reusable=not self.description.lights)

    def _load_world(self) -> None:
        self._world, self._steps = load_world(self._client, self.description), 0
        self._moving = [each for each in self._world.handles.values() if each.body.kind == "moving"]

    def _set_world_body_state(self, name: str, state: BodyState) -> None:
        handle = self._world.handles[name]
        if handle.body.kind == "moving":
            raise BadInput(f"{name!r} follows its path: nothing else moves it")
        others = {other: pose for other, pose in self._places().items() if other != name}
        pose = Pose3(state.position, state.orientation)
        self._collision_checker.check_world_body(name, pose, self._configurations(), others)
        handle.set_state(state)

    def _check(self, name: str, configuration: Configuration) -> None:
        others = {other: where for other, where in self._configurations().items() if other != name}
        self._collision_checker.check(name, configuration, others, self._places())

    def _places(self) -> dict[str, Pose3]:
        """Return the poses of the world's movable and moving bodies."""
        states = {name: handle.state() for name, handle in self._world.handles.items()}
        return {name: Pose3(state.position, state.orientation) for name, state in states.items()}

    def _configurations(self) -> dict[str, Configuration]:
        return {name: body.configuration for name, body in self._bodies.items()}


def _load(body: BulletBody) -> None:
    body.load()
    body.set_speeds((0.0,) * len(body.max_torques))


def render_image(client: int, eye: Pose3, camera: CameraModel, lights: tuple[Light, ...] = ()) -> bytes:
    """Render the image from ``eye`` (z forward, x right, y down): rows from the top, three bytes RGB per pixel.

    The first of ``lights`` replaces PyBullet's own.
    """
    lit = {}
    for light in lights[:1]:
        x, y, z = light.direction
        lit = {"lightDirection": (-x, -y, -z), "lightColor": light.colour}
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
        **lit,
        physicsClientId=client,
    )
    pixels = np.asarray(image[2], np.uint8).reshape(camera.height, camera.width, 4)
    return pixels[:, :, :3].tobytes()
