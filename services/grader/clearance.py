"""How near each robot came to a body of the world."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3
from services.grader import SizeSpec
from services.markers.footprint import Footprint, NearestBody
from services.markers.world_bodies import FIXED, GROUND, World, WorldBody

STEP_HEIGHT = 0.02
"""m; what reaches no higher above the lowest point of a robot is driven over."""

AT_REST = 1e-6
"""m, and of a quaternion's components; a body that moved by less has not moved."""

PATH_STEP, MAX_PATH = 0.05, 4000
"""m between two points of a body's path, and how many of them are kept."""

MAX_WAITING = 50_000
"""Samples that wait for the next state of the world's moving bodies, beyond which the last known one counts; and states
that are kept."""

Floats = NDArray[np.float64]
Poses = Mapping[str, Pose3]


class Clearance(NamedTuple):
    """The least distance [m] between a robot's circle and a body's outline, when it was [s], and the body's name."""

    distance: float = math.inf
    at: float = math.nan
    body: str = ""


FAR = Clearance()


class _Sample(NamedTuple):
    stamp: int
    robot: str
    x: float
    y: float
    z: float


class ClearanceMeter:
    """Measures the clearance of robots of the given sizes from the bodies of the world.

    ``least`` has the smallest of each robot, ``paths`` the points [m] through which each body moved.

    Distances are planar: the robot is the circle of its radius, a body its outline from above. Bodies that lie higher
    than the robot reaches, and those over which it drives, do not count. Samples wait until the world is known, and
    with moving bodies until the state after them is: where these are in between is interpolated.
    """

    def __init__(self, sizes: Mapping[str, SizeSpec]) -> None:
        self.least: dict[str, Clearance] = {}
        self.paths: dict[str, list[tuple[float, float]]] = {}
        self.world_known = False
        self._sizes = sizes
        self._samples: list[_Sample] = []
        self._fixed: list[str] = []
        self._search = NearestBody([])
        self._others: dict[str, WorldBody] = {}
        self._poses: dict[str, Pose3] = {}
        self._placed: dict[str, list[Footprint]] = {}
        self._stamps: list[int] = []
        self._states: list[Poses] = []

    def set_world(self, bodies: World) -> None:
        """Set the bodies of the world, each with what it covers at the start."""
        self.world_known = True
        self._fixed = [body.name for body, _ in bodies if body.kind == FIXED]
        self._search = NearestBody([parts for body, parts in bodies if body.kind == FIXED])
        others = [(body, parts) for body, parts in bodies if body.kind not in (FIXED, GROUND)]
        self._others = {body.name: body for body, _ in others}
        self._poses = {body.name: body.pose for body, _ in others}
        self._placed = {body.name: parts for body, parts in others}
        self.paths = {name: [pose.position[:2]] for name, pose in self._poses.items()}

    def add_states(self, stamp: int, poses: Poses) -> None:
        """Add the poses of the bodies that move or can be moved at ``stamp`` [ns], in the order of the stamps."""
        if not self._stamps or stamp > self._stamps[-1]:
            self._stamps.append(stamp)
            self._states.append(poses)
        if len(self._stamps) > MAX_WAITING:
            del self._stamps[0], self._states[0]

    def add_position(self, stamp: int, robot: str, position: tuple[float, float, float]) -> None:
        """Add the true position [m] of a robot's base frame at ``stamp`` [ns]."""
        if robot in self._sizes:
            self._samples.append(_Sample(stamp, robot, *position))

    def update(self, final: bool = False) -> None:
        """Measure the samples whose surroundings are known by now; with ``final``, all."""
        if not self.world_known:
            self._samples = self._samples[-MAX_WAITING:]
            return
        known = self._stamps[-1] if self._stamps else -1
        if not self._others or final or len(self._samples) > MAX_WAITING:
            ready, self._samples = self._samples, []
        else:
            ready = [each for each in self._samples if each.stamp <= known]
            self._samples = [each for each in self._samples if each.stamp > known]
        if ready:
            self._measure(ready, self._fixed, self._search)
        if not self._others:
            return
        ready.sort(key=lambda each: each.stamp)
        for stamp, samples in groupby(ready, key=lambda each: each.stamp):
            self._place_others(stamp)
            self._measure(list(samples), list(self._placed), NearestBody(list(self._placed.values())))

    def _measure(self, samples: Sequence[_Sample], names: Sequence[str], search: NearestBody) -> None:
        sizes = [self._sizes[each.robot] for each in samples]
        tops = [math.inf if each.top is None else each.top for each in sizes]
        heights, radii = np.array([each.z for each in samples]), np.array([each.radius for each in sizes])
        least = np.array([self.least.get(each.robot, FAR).distance for each in samples])
        distances, bodies = search.find(
            np.array([(each.x, each.y) for each in samples]),
            heights + [each.bottom + STEP_HEIGHT for each in sizes],
            heights + tops,
            least + radii,
        )
        for sample, clear, body in zip(samples, (distances - radii).tolist(), bodies.tolist(), strict=True):
            if clear < self.least.get(sample.robot, FAR).distance:
                self.least[sample.robot] = Clearance(clear, sample.stamp / 1e9, names[body])

    def _place_others(self, stamp: int) -> None:
        """Put the bodies that move to where they are at ``stamp`` [ns]."""
        poses = self._poses_at(stamp)
        for name, body in self._others.items():
            pose = poses.get(name)
            if pose is not None and _moved(self._poses[name], pose):
                self._poses[name], self._placed[name] = pose, body.footprints(pose)
                self._follow(name, pose)

    def _follow(self, name: str, pose: Pose3) -> None:
        path, (x, y, _) = self.paths[name], pose.position
        if math.hypot(x - path[-1][0], y - path[-1][1]) > PATH_STEP and len(path) < MAX_PATH:
            path.append((x, y))

    def _poses_at(self, stamp: int) -> Poses:
        after = bisect_right(self._stamps, stamp)
        if after > 1:  # none before is asked for again
            del self._stamps[: after - 1], self._states[: after - 1]
            after = 1
        if after == 0 or after == len(self._stamps):
            return self._states[after - 1] if after else {}
        (early, late), (one, other) = self._stamps[:2], self._states[:2]
        share = (stamp - early) / (late - early)
        return {name: pose.interpolate(other[name], share) for name, pose in one.items() if name in other}


def _moved(before: Pose3, after: Pose3) -> bool:
    return any(
        abs(a - b) > AT_REST
        for a, b in zip((*before.position, *before.orientation), (*after.position, *after.orientation), strict=True)
    )
