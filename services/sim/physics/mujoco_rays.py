"""Ray casting for sensors: the model that rays hit, and the hits on the robot's own part that carries the sensor."""

from __future__ import annotations

import copy
from math import inf

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3, rotated_axes
from models.world import WorldDescription
from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_robot import RobotTree
from services.sim.physics.mujoco_scene import SEEN_GROUPS, PlacedRobot, SceneBuilder

Floats = NDArray[np.float64]

_ALOFT = Pose3((0.0, 0.0, 1e4))
"""High enough that no ray hits the ground."""
_ROUNDING = 1e-6
"""m; a body out of reach by less counts as within."""
_KEPT = 256
_known: dict[tuple[object, ...], tuple[RobotTree, Floats]] = {}
"""Results by key, each with the tree whose id is in the key, so that no other object gets that id."""


class RayModel:
    """A copy of the model for ray casting, in which bodies that rays cannot hit have no shapes.

    The engine checks every body for every ray, and two thirds of those of a hundred burgers are wheels, which rays
    ignore. With bodies out of reach left out, too, the rays take a third of the time; the hits are the same, bit for
    bit.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = copy.copy(model)
        self._shapes = np.flatnonzero(SEEN_GROUPS[model.geom_group])
        bodies = model.geom_bodyid[self._shapes]
        self._starts = np.flatnonzero(np.diff(bodies, prepend=-1))
        self._bodies = bodies[self._starts]
        self._counts, self._trees = model.body_geomnum[self._bodies], model.body_bvhadr[self._bodies]
        reach = model.geom_rbound[self._shapes]
        self._reach = np.where(reach > 0, reach, inf)  # a plane has no bound
        self.keep_all()

    def near(self, data: mujoco.MjData, origins: Floats, far: float) -> NDArray[np.bool_]:
        """Return which bodies rays of length ``far`` [m] may hit from each of the origins, shape (n, 3).

        Each row is an argument for ``keep``.
        """
        places = data.geom_xpos[self._shapes]
        squares = sum((origins[:, None, axis] - places[None, :, axis]) ** 2 for axis in range(3))
        return np.logical_or.reduceat(squares <= (self._reach + far + _ROUNDING) ** 2, self._starts, axis=1)

    def keep(self, near: NDArray[np.bool_]) -> None:
        """Leave out all other bodies from now on."""
        model, kept = self.model, self._bodies[near]
        model.body_geomnum[:], model.body_bvhadr[:] = 0, -1
        model.body_geomnum[kept], model.body_bvhadr[kept] = self._counts[near], self._trees[near]

    def keep_all(self) -> None:
        """Leave out nothing that rays hit."""
        self.keep(np.ones(len(self._bodies), np.bool_))


def own_hits(tree: RobotTree, link: str, mount: Pose3, rays: Floats, near: float, far: float) -> Floats:
    """Return the distance at which a sensor's rays hit the part that carries it, m, shape (n,); inf without a hit.

    Rays begin ``near`` and end ``far`` from the sensor. Computed once for all robots of a kind.
    """
    key = id(tree), link, mount, rays.tobytes(), near, far
    if (known := _known.get(key)) is None:
        while len(_known) >= _KEPT:
            _known.pop(next(iter(_known)))
        known = _known[key] = tree, _cast(tree, link, mount, rays, near, far)
    return known[1]


def _cast(tree: RobotTree, link: str, mount: Pose3, rays: Floats, near: float, far: float) -> Floats:
    builder = SceneBuilder(WorldDescription(), 1.0)
    builder.add_robot(PlacedRobot("robot", tree, _ALOFT, fixed=False))
    model = builder.compile().model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    part, place = tree.links[link]
    x, y, z = data.xpos[1 + part].tolist()
    w, i, j, k = data.xquat[1 + part].tolist()
    eye = Pose3((x, y, z), (i, j, k, w)) @ place @ mount
    directions, hit = rays @ np.array(rotated_axes(eye.orientation)), np.zeros(1, np.int32)
    found = np.full(len(rays), inf)
    for number, direction in enumerate(directions):
        start = np.array(eye.position) + near * direction
        distance = mujoco.mj_ray(model, data, start, direction, SEEN_GROUPS, 1, -1, hit)
        if 0 <= distance <= far - near and model.geom_bodyid[hit[0]] == 1 + part:
            found[number] = near + distance
    return found
