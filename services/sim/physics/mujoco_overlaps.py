"""Overlap checks in MuJoCo before a body is spawned or moved, on small models of it and its surroundings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from messages.se3 import Pose3, rotate
from models.bodies import BodyPart, BoxShape, CylinderShape, HeightMapShape, MeshShape, RampShape, SphereShape
from models.world import WorldBody, WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_scene import GROUNDS, PlacedRobot, SceneBuilder, wxyz
from services.sim.physics.world import MAX_PENETRATION, MAX_SUNK, Configuration

_SKY = 1e4
"""m; nothing is higher."""
_GROUNDS_ONLY = np.array([number == GROUNDS for number in range(6)], np.uint8)

Placed = tuple[PlacedRobot, Configuration]


class OverlapChecker:
    """Checks intended poses of bodies in a world.

    The world itself is not touched before the place is known to be free: a body that starts inside another is thrown
    metres into the air.
    """

    def __init__(self, world: WorldDescription) -> None:
        self._world = world
        self._reach = {body.name: [_reach(part) for part in body.parts] for body in world.all_bodies}
        grounds = [_with_parts(body, lambda part: part.ground) for body in world.all_bodies]
        self._grounds = [body for body in grounds if body.parts]
        maps = [_with_parts(body, lambda part: isinstance(part.shape, HeightMapShape)) for body in self._grounds]
        self._height_maps = [body for body in maps if body.parts]
        self._ground_models: dict[str, tuple[mujoco.MjModel, mujoco.MjData]] = {}

    @property
    def has_grounds(self) -> bool:
        """Whether there is ground besides the plane."""
        return bool(self._grounds)

    def check(
        self,
        robot: PlacedRobot,
        configuration: Configuration,
        others: Mapping[str, Placed],
        places: Mapping[str, Pose3],
    ) -> None:
        """Check a configuration of a body for overlaps.

        Args:
            robot: The body.
            configuration: Its intended configuration.
            others: Configurations of the other spawned bodies.
            places: Poses of the world's movable and moving bodies.

        Raises:
            BadInput: It would overlap with something; names what, and by how much.
        """
        pose = configuration.pose
        height = self._height(self._height_maps, *pose.position[:2], places)
        x, y, z = pose.position
        if height is not None and height > z + MAX_SUNK:
            raise BadInput(
                f"{robot.name!r} at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m would be below the height map, whose "
                f"ground is {height:.3f} m high there"
            )
        bodies = self._near(pose.position, robot.tree.reach, places)
        near = {name: each for name, each in others.items() if _are_near(pose, robot, each)}
        self._check(robot.name, pose, bodies, [(robot, configuration), *near.values()])

    def check_world_body(
        self, name: str, pose: Pose3, others: Mapping[str, Placed], places: Mapping[str, Pose3]
    ) -> None:
        """Like ``check``, for a movable body of the world at the intended ``pose``."""
        radius = max(reach + math.dist((0.0, 0.0, 0.0), centre) for centre, reach in self._reach[name])
        bodies = self._near(pose.position, radius, {**places, name: pose})
        near = [
            each
            for each in others.values()
            if math.dist(each[1].pose.position, pose.position) < each[0].tree.reach + radius
        ]
        self._check(name, pose, bodies, near)

    def ground_height(self, x: float, y: float, places: Mapping[str, Pose3]) -> float | None:
        """Return the height [m] of the highest ground at a point, except the plane; None if there is none."""
        return self._height(self._grounds, x, y, places)

    def close(self) -> None:
        """Drop the models."""
        self._ground_models.clear()

    def _check(self, name: str, pose: Pose3, bodies: Sequence[WorldBody], robots: Sequence[Placed]) -> None:
        builder = SceneBuilder(self._world, 1.0)
        for body in bodies:
            moving = body.name == name
            builder.add_body(body if moving else replace(body, mass=0.0, path=None))
        for robot, _ in robots:
            builder.add_robot(replace(robot, fixed=False))
        scene = builder.compile()
        data = mujoco.MjData(scene.model)
        position = 7 if any(body.name == name for body in bodies) else 0
        for robot, configuration in robots:
            data.qpos[position : position + 3] = configuration.pose.position
            data.qpos[position + 3 : position + 7] = wxyz(configuration.pose.orientation)
            for joint, value in configuration.joints.items():
                data.qpos[position + 6 + robot.tree.joints[joint]] = value
            position += 6 + len(robot.tree.parts)
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_comPos(scene.model, data)
        mujoco.mj_collision(scene.model, data)
        deepest: dict[int, float] = {}
        own = scene.owners.index(name)
        for (one, other), distance in zip(scene.owner[data.contact.geom].tolist(), data.contact.dist, strict=True):
            if own in (one, other) and one != other:
                touched = other if one == own else one
                deepest[touched] = max(deepest.get(touched, 0.0), -float(distance))
        spawned = {robot.name for robot, _ in robots}
        for touched in sorted(deepest):
            if deepest[touched] > MAX_PENETRATION:
                other = "the ground" if touched < 0 else scene.owners[touched]
                x, y, z = pose.position
                raise BadInput(
                    f"{name!r} at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m would overlap with "
                    f"{repr(other) if other in spawned else other} by {deepest[touched]:.3f} m"
                )

    def _near(self, at: Sequence[float], radius: float, places: Mapping[str, Pose3]) -> list[WorldBody]:
        """Return the parts of the world's bodies within ``radius`` of a point, each body at its current pose."""
        found = []
        for body in self._world.all_bodies:
            pose = places.get(body.name, body.pose)
            parts = tuple(
                part
                for part, (centre, reach) in zip(body.parts, self._reach[body.name], strict=True)
                if part.solid and math.dist((pose @ Pose3(centre)).position, at) < reach + radius
            )
            if parts:
                found.append(replace(body, pose=pose, parts=parts))
        return found

    def _height(self, bodies: Sequence[WorldBody], x: float, y: float, places: Mapping[str, Pose3]) -> float | None:
        if not bodies:
            return None
        placed = [replace(body, mass=0.0, path=None, pose=places.get(body.name, body.pose)) for body in bodies]
        key = repr([(body.name, body.pose) for body in placed])
        if key not in self._ground_models:
            builder = SceneBuilder(self._world, 1.0)
            for body in placed:
                builder.add_body(body)
            model = builder.compile().model
            data = mujoco.MjData(model)
            mujoco.mj_kinematics(model, data)
            self._ground_models = {**dict(list(self._ground_models.items())[-1:]), key: (model, data)}
        model, data = self._ground_models[key]
        hit = np.zeros(1, np.int32)
        distance = mujoco.mj_ray(
            model, data, np.array((x, y, _SKY)), np.array((0.0, 0.0, -1.0)), _GROUNDS_ONLY, 1, -1, hit
        )
        return _SKY - distance if distance >= 0 else None


def _are_near(pose: Pose3, robot: PlacedRobot, other: Placed) -> bool:
    return math.dist(pose.position, other[1].pose.position) < robot.tree.reach + other[0].tree.reach


def _with_parts(body: WorldBody, predicate: Callable[[BodyPart], bool]) -> WorldBody:
    return replace(body, parts=tuple(part for part in body.parts if part.solid and predicate(part)))


def _reach(part: BodyPart) -> tuple[tuple[float, float, float], float]:
    """Return a sphere around a part: its centre in the body's frame, and its radius, m."""
    match part.shape:
        case BoxShape(size) | RampShape(size):
            return part.pose.position, math.hypot(*size) / 2
        case CylinderShape(radius, length):
            return part.pose.position, math.hypot(radius, length / 2)
        case SphereShape(radius):
            return part.pose.position, radius
        case HeightMapShape(heights, (x, y)):
            low, high = float(heights.min()), float(heights.max())
            # It is a surface, below which nothing overlaps with it: count it at any distance above or below.
            return part.pose.position, math.hypot(x / 2, y / 2) + max(abs(low), abs(high)) + _SKY
        case MeshShape(mesh):
            low, high = mesh.bounds
            x, y, z = rotate(part.pose.orientation, tuple(((low + high) / 2).tolist()))
            at = part.pose.position
            return (at[0] + x, at[1] + y, at[2] + z), float(np.linalg.norm(high - low)) / 2
