"""Overlap checks in PyBullet before a body is spawned or moved, on copies in a separate client.

A body that starts inside another is thrown metres into the air, and one that is loaded and removed again would change
the trajectories of the others. So the world itself is not touched before the place is known to be free.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from messages.se3 import Pose3
from models.world import WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics._pybullet import pybullet
from services.sim.physics.bullet_body import BulletBody
from services.sim.physics.engine import connect, disconnect, is_roller, load_world
from services.sim.physics.world import MAX_PENETRATION, MAX_SUNK, Body, Configuration
from services.sim.physics.world_bodies import ground_height

_GROUND = 0
"""The number of the ground, which is loaded first."""


class CollisionChecker:
    """Copies of a world's ground, obstacles and bodies, which are placed but never stepped."""

    def __init__(self, world: WorldDescription) -> None:
        self._client = connect(1.0)
        self._world = load_world(self._client, _without_looks(world))
        self._static_bodies = {_GROUND: "the ground", **self._world.names}
        self._copies: dict[str, BulletBody] = {}

    def add(self, body: Body, others: Mapping[str, Configuration], places: Mapping[str, Pose3]) -> None:
        """Copy a new body; raises BadInput if it would overlap with ``others``, the world's bodies or the ground."""
        name = body.name
        copy = BulletBody(self._client, body)
        copy.load()
        self._copies[name] = copy
        try:
            self.check(name, Configuration(body.pose, dict(body.initial_positions)), others, places)
        except BadInput:
            self.remove(name)
            raise

    def check(
        self,
        name: str,
        configuration: Configuration,
        others: Mapping[str, Configuration],
        places: Mapping[str, Pose3],
    ) -> None:
        """Check a configuration of a body for overlaps.

        Args:
            name: The body.
            configuration: Its intended configuration.
            others: Configurations of the other spawned bodies.
            places: Poses of the world's movable and moving bodies.

        Raises:
            BadInput: It would overlap with something; names what, and by how much.
        """
        copy, pose = self._copies[name], configuration.pose
        self._set_configuration(copy, configuration)
        self._set_places(places)
        for number, obstacle in self._static_bodies.items():
            self._check_pair(name, pose, copy.body_id, number, obstacle)
        for other, placed in others.items():
            self._set_configuration(self._copies[other], placed)
            self._check_pair(name, pose, copy.body_id, self._copies[other].body_id, repr(other))
        self._check_above_ground(name, pose)

    def check_world_body(
        self, name: str, pose: Pose3, others: Mapping[str, Configuration], places: Mapping[str, Pose3]
    ) -> None:
        """Like ``check``, for a movable body of the world at the intended ``pose``."""
        handle = self._world.handles[name]
        self._set_places({**places, name: pose})
        for number, obstacle in self._static_bodies.items():
            if number != handle.number:
                self._check_pair(name, pose, handle.number, number, obstacle)
        for other, placed in others.items():
            self._set_configuration(self._copies[other], placed)
            self._check_pair(name, pose, self._copies[other].body_id, handle.number, repr(other))

    def overlaps_at_start(self) -> tuple[str, ...]:
        """Return a line for each movable body that the world's file places inside another: which, and by how much."""
        found = []
        for name, handle in self._world.handles.items():
            if handle.body.kind == "movable":
                try:
                    self.check_world_body(name, handle.body.pose, {}, {})
                except BadInput as error:
                    found.append(str(error))
        return tuple(found)

    def remove(self, name: str) -> None:
        """Remove the copy of a deleted body."""
        pybullet.removeBody(self._copies.pop(name).body_id, physicsClientId=self._client)

    def close(self) -> None:
        """Close the client."""
        disconnect(self._client)

    def _set_places(self, places: Mapping[str, Pose3]) -> None:
        for name, pose in places.items():
            self._world.handles[name].set_pose(pose)

    def _set_configuration(self, copy: BulletBody, configuration: Configuration) -> None:
        copy.place(configuration.pose)
        copy.set_joints(configuration.joints)

    def _check_pair(self, name: str, pose: Pose3, copy: int, number: int, other: str) -> None:
        near = pybullet.getClosestPoints(copy, number, 0.0, physicsClientId=self._client)
        depth = -min((point[8] for point in near if self._may_collide(copy, number, *point[3:5])), default=0.0)
        if depth > MAX_PENETRATION:
            x, y, z = pose.position
            raise BadInput(
                f"{name!r} at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m would overlap with {other} by {depth:.3f} m"
            )

    def _check_above_ground(self, name: str, pose: Pose3) -> None:
        """Check against height maps: they are surfaces, so nothing below one overlaps with it."""
        x, y, z = pose.position
        height = ground_height(self._client, self._world.height_maps, x, y)
        if height is not None and height > z + MAX_SUNK:
            raise BadInput(
                f"{name!r} at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m would be below the height map, whose ground is "
                f"{height:.3f} m high there"
            )

    def _may_collide(self, copy: int, number: int, link: int, other: int) -> bool:
        # Distance queries ignore collision filters.
        if number == _GROUND or number in self._world.grounds:
            return True
        return not (self._rolls(copy, link) or self._rolls(number, other))

    def _rolls(self, number: int, link: int) -> bool:
        """Return whether a link rolls; a ball of the world itself does not count as a wheel."""
        return number not in self._static_bodies and is_roller(self._client, number, link)


def _without_looks(world: WorldDescription) -> WorldDescription:
    """Return the world without its visual shapes: a building of meshes loads in half the time."""
    bodies = [
        replace(body, parts=tuple(replace(part, visible=False) for part in body.parts if part.solid))
        for body in world.bodies
    ]
    return replace(world, bodies=tuple(bodies))
