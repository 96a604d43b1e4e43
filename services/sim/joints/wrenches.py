"""Wrenches on the links of all bodies: the jobs that are on them, applied at each step."""

from __future__ import annotations

from typing import NamedTuple

from messages.se3 import Vector, rotate
from services.runtime.errors import BadInput
from services.runtime.log import Log
from services.sim.entities import ScopedName, frame_state
from services.sim.joints.jobs import Job, JobQueue
from services.sim.physics.world import World


class LinkWrench(NamedTuple):
    """A force [N] and a torque [N m] in the axes of ``frame``, the force at a point [m] of the link's own frame."""

    force: Vector
    torque: Vector
    point: Vector
    frame: str


class LinkWrenches:
    """All that act on a link add up, as in Gazebo."""

    def __init__(self, world: World, log: Log) -> None:
        self._world, self._log = world, log
        self._jobs: dict[ScopedName, JobQueue[LinkWrench]] = {}

    def add(self, link: ScopedName, job: Job[LinkWrench]) -> None:
        """Take a job; raises BadInput when there are too many."""
        self._jobs.setdefault(link, JobQueue()).add(job)

    def clear(self, link: ScopedName) -> int:
        """Drop the jobs of a link; returns how many."""
        jobs = self._jobs.pop(link, None)
        return 0 if jobs is None else len(jobs)

    def count(self, link: ScopedName) -> int:
        """How many jobs wait or act on a link."""
        return len(self._jobs.get(link, ()))

    def remove_body(self, body: str) -> None:
        """A body leaves the world."""
        self._jobs = {link: jobs for link, jobs in self._jobs.items() if link.body != body}

    def reset(self) -> None:
        """Drop all jobs."""
        self._jobs.clear()

    def step(self, now: int) -> None:
        """Apply what acts in the step that begins at ``now`` [ns]."""
        for link, jobs in list(self._jobs.items()):
            for wrench in jobs.active(now):
                self._apply(link, wrench)
            if not jobs:
                self._jobs.pop(link, None)

    def _apply(self, link: ScopedName, wrench: LinkWrench) -> None:
        try:
            axes = frame_state(self._world, wrench.frame).orientation
        except BadInput as error:
            self._log.warn(f"the wrenches on {link} are dropped: {error}")
            self.clear(link)
            return
        pose = self._world.link_pose(*link)
        x, y, z = rotate(pose.orientation, wrench.point)
        a, b, c = pose.position
        self._world.apply_wrench(*link, rotate(axes, wrench.force), rotate(axes, wrench.torque), (a + x, b + y, c + z))
