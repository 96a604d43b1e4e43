"""The clearance of each robot from the bodies of the world."""

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
"""Height [m] above a robot's lowest point up to which it drives over a body."""

AT_REST = 1e-6
"""Tolerance in m, and of quaternion components, below which a body has not moved."""

PATH_STEP, MAX_PATH = 0.05, 4000
"""Distance [m] between two points of a body's path, and the maximum number of points kept."""

MAX_WAITING = 50_000
"""Maximum number of samples that wait for the next state of the moving bodies, beyond which the last known state is
used; also the maximum number of states kept."""

Floats = NDArray[np.float64]
Poses = Mapping[str, Pose3]


class Clearance(NamedTuple):
    """The smallest distance [m] between a robot's circle and a body's outline, its time [s], and the body's name."""

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

    ``least`` holds the smallest clearance of each robot, ``paths`` the points [m] through which each body moved.

    Distances are planar: the robot is the circle of its radius, a body its outline from above. Bodies above the robot's
    top, and those that it can drive over, are ignored. Samples wait until the world is known, and with moving bodies
    until their next state has arrived, so that their poses can be interpolated.
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
        """Set the bodies of the world, each with its footprint at the start."""
        self.world_known = True
        self._fixed = [body.name for body, _ in bodies if body.kind == FIXED]
        self._search = NearestBody([parts for body, parts in bodies if body.kind == FIXED])
        others = [(body, parts) for body, parts in bodies if body.kind not in (FIXED, GROUND)]
        self._others = {body.name: body for body, _ in others}
        self._poses = {body.name: body.pose for body, _ in others}
        self._placed = {body.name: parts for body, parts in others}
        self.paths = {name: [pose.position[:2]] for name, pose in self._poses.items()}

    def add_states(self, stamp: int, poses: Poses) -> None:
        """Add the poses of the movable and moving bodies at ``stamp`` [ns], in order of stamps."""
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
        """Measure the samples for which all body poses are known; with ``final``, all samples."""
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
        """Place the movable and moving bodies at their poses at ``stamp`` [ns]."""
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
        if after > 1:  # no earlier state is needed again
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
