"""Distances before a body enters the world, measured on copies in a client of their own.

A body that starts inside another is thrown metres into the air, and one that was loaded and taken out again would
change the trajectories of the others: so the world itself is not touched before the place is known to be free.
"""

from __future__ import annotations

from collections.abc import Mapping

from models.scene import Scene
from services.runtime.errors import BadInput
from services.sim.physics.engine import connect, load_scene, rolls
from services.sim.physics.loaded import Loaded, load
from services.sim.physics.quiet import pybullet
from services.sim.physics.world import Body, Placement, Stance

DEEPEST = 0.002
"""Bodies may reach this far, m, into each other or the ground: what resting on it takes, and rounding."""


_GROUND = 0
"""The number of what was loaded first."""


class Clearance:
    """Copies of a world's ground, obstacles and bodies, none of which ever moves by itself."""

    def __init__(self, scene: Scene) -> None:
        self._client = connect(1.0)
        self._fixed = {_GROUND: "the ground", **load_scene(self._client, scene)}
        self._copies: dict[str, Loaded] = {}

    def admit(self, body: Body, others: Mapping[str, Stance]) -> None:
        """Copy a newcomer; raises BadInput if it would overlap with ``others``, an obstacle or the ground."""
        name = body.name
        self._copies[name] = load(self._client, body)
        try:
            self.check(name, Stance(body.placement, dict(body.start)), others)
        except BadInput:
            self.forget(name)
            raise

    def check(self, name: str, stance: Stance, others: Mapping[str, Stance]) -> None:
        """Raise BadInput, with what and by how much, if ``name`` would overlap with anything in a stance."""
        copy, placement = self._copies[name], stance.placement
        self._place(copy, stance)
        for number, obstacle in self._fixed.items():
            self._compare(name, placement, copy.number, number, obstacle)
        for other, where in others.items():
            self._place(self._copies[other], where)
            self._compare(name, placement, copy.number, self._copies[other].number, repr(other))

    def forget(self, name: str) -> None:
        """Drop the copy of a body that left."""
        pybullet.removeBody(self._copies.pop(name).number, physicsClientId=self._client)

    def close(self) -> None:
        """End the client."""
        pybullet.disconnect(physicsClientId=self._client)

    def _place(self, copy: Loaded, stance: Stance) -> None:
        pybullet.resetBasePositionAndOrientation(copy.number, *stance.placement, physicsClientId=self._client)
        copy.set_joints(stance.joints)

    def _compare(self, name: str, placement: Placement, copy: int, number: int, other: str) -> None:
        near = pybullet.getClosestPoints(copy, number, 0.0, physicsClientId=self._client)
        depth = -min((point[8] for point in near if self._meet(copy, number, *point[3:5])), default=0.0)
        if depth > DEEPEST:
            x, y, z = placement.position
            raise BadInput(
                f"{name!r} at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m would overlap with {other} by {depth:.3f} m"
            )

    def _meet(self, copy: int, number: int, link: int, other: int) -> bool:
        # Distances know nothing of who may touch whom.
        ground = number == _GROUND
        return ground or not (rolls(self._client, copy, link) or rolls(self._client, number, other))
