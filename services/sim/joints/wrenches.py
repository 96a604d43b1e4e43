"""Wrenches on the links of all bodies: their queued jobs, applied at each step."""

from __future__ import annotations

from typing import NamedTuple

from messages.se3 import Vector, rotate
from services.runtime.errors import BadInput
from services.runtime.log import Log
from services.sim.entities import ScopedName, frame_state
from services.sim.joints.jobs import Job, JobQueue
from services.sim.physics.world import World


class LinkWrench(NamedTuple):
    """A force [N] and a torque [N m] in the axes of ``frame``; the force acts at ``point`` [m] in the link's frame."""

    force: Vector
    torque: Vector
    point: Vector
    frame: str


class LinkWrenches:
    """The wrenches on links; those that act on one link add up, as in Gazebo."""

    def __init__(self, world: World, log: Log) -> None:
        self._world, self._log = world, log
        self._jobs: dict[ScopedName, JobQueue[LinkWrench]] = {}

    def add(self, link: ScopedName, job: Job[LinkWrench]) -> None:
        """Queue a job; raises BadInput if too many are queued."""
        self._jobs.setdefault(link, JobQueue()).add(job)

    def clear(self, link: ScopedName) -> int:
        """Drop the jobs of a link; return how many."""
        jobs = self._jobs.pop(link, None)
        return 0 if jobs is None else len(jobs)

    def count(self, link: ScopedName) -> int:
        """Return the number of jobs queued or acting on a link."""
        return len(self._jobs.get(link, ()))

    def remove_body(self, body: str) -> None:
        """Drop the jobs of a body that is deleted."""
        self._jobs = {link: jobs for link, jobs in self._jobs.items() if link.body != body}

    def reset(self) -> None:
        """Drop all jobs."""
        self._jobs.clear()

    def step(self, now: int) -> None:
        """Apply the wrenches of the step that begins at ``now`` [ns]."""
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
        body = self._world.body(link.body)
        pose = body.link_pose(link.name)
        x, y, z = rotate(pose.orientation, wrench.point)
        a, b, c = pose.position
        body.apply_wrench(link.name, rotate(axes, wrench.force), rotate(axes, wrench.torque), (a + x, b + y, c + z))
