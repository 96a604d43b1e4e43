"""Distances before a body enters the world, measured on copies in a client of their own.

A body that starts inside another is thrown metres into the air, and one that was loaded and taken out again would
change the trajectories of the others: so the world itself is not touched before the place is known to be free.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from models.scene import Scene
from services.runtime.errors import BadInput
from services.sim.engine import connect, load_body, load_scene, rolls
from services.sim.quiet import pybullet
from services.sim.world import Placement

DEEPEST = 0.002
"""Bodies may reach this far, m, into each other or the ground: what resting on it takes, and rounding."""


_GROUND = 0
"""The number of what was loaded first."""


class Clearance:
    """Copies of a world's ground, obstacles and bodies, none of which ever moves by itself."""

    def __init__(self, scene: Scene) -> None:
        self._client = connect(1.0)
        self._fixed = {_GROUND: "the ground", **load_scene(self._client, scene)}
        self._copies: dict[str, int] = {}

    def admit(self, name: str, urdf: Path, placement: Placement, others: Mapping[str, Placement]) -> None:
        """Copy a newcomer; raises BadInput if it would overlap with ``others``, an obstacle or the ground."""
        self._copies[name] = load_body(self._client, urdf, placement)
        try:
            self.check(name, placement, others)
        except BadInput:
            self.forget(name)
            raise

    def check(self, name: str, placement: Placement, others: Mapping[str, Placement]) -> None:
        """Raise BadInput, with what and by how much, if ``name`` would overlap with anything at ``placement``."""
        copy = self._copies[name]
        self._place(copy, placement)
        for number, obstacle in self._fixed.items():
            self._compare(name, placement, copy, number, obstacle)
        for other, where in others.items():
            self._place(self._copies[other], where)
            self._compare(name, placement, copy, self._copies[other], repr(other))

    def forget(self, name: str) -> None:
        """Drop the copy of a body that left."""
        pybullet.removeBody(self._copies.pop(name), physicsClientId=self._client)

    def close(self) -> None:
        """End the client."""
        pybullet.disconnect(physicsClientId=self._client)

    def _place(self, number: int, placement: Placement) -> None:
        pybullet.resetBasePositionAndOrientation(number, *placement, physicsClientId=self._client)

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
