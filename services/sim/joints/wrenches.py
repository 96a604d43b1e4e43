"""Wrenches on the links of all bodies: the jobs that are on them, applied at each step."""

from __future__ import annotations

from typing import NamedTuple

from services.runtime.errors import BadInput
from services.runtime.log import Log
from services.sim.entities import Part, frame_state
from services.sim.joints.jobs import Job, Jobs
from services.sim.physics.rotation import into_world
from services.sim.physics.world import Vector, World


class Push(NamedTuple):
    """A force [N] and a torque [N m] in the axes of ``frame``, the force at a point [m] of the link's own frame."""

    force: Vector
    torque: Vector
    point: Vector
    frame: str


class Wrenches:
    """All that act on a link add up, as in Gazebo."""

    def __init__(self, world: World, log: Log) -> None:
        self._world, self._log = world, log
        self._jobs: dict[Part, Jobs[Push]] = {}

    def add(self, link: Part, job: Job[Push]) -> None:
        """Take a job; raises BadInput when there are too many."""
        self._jobs.setdefault(link, Jobs()).add(job)

    def clear(self, link: Part) -> int:
        """Drop the jobs of a link; returns how many."""
        jobs = self._jobs.pop(link, None)
        return 0 if jobs is None else len(jobs)

    def count(self, link: Part) -> int:
        """How many jobs wait or act on a link."""
        return len(self._jobs.get(link, ()))

    def forget(self, body: str) -> None:
        """A body leaves the world."""
        self._jobs = {link: jobs for link, jobs in self._jobs.items() if link.body != body}

    def restart(self) -> None:
        """Drop all jobs."""
        self._jobs.clear()

    def step(self, now: int) -> None:
        """Apply what acts in the step that begins at ``now`` [ns]."""
        for link, jobs in list(self._jobs.items()):
            for push in jobs.all(now):
                self._apply(link, push)
            if not jobs:
                self._jobs.pop(link, None)

    def _apply(self, link: Part, push: Push) -> None:
        try:
            turn = frame_state(self._world, push.frame).orientation
        except BadInput as error:
            self._log.warn(f"the wrenches on {link} are dropped: {error}")
            self.clear(link)
            return
        place = self._world.link_placement(*link)
        x, y, z = into_world(place.orientation, push.point)
        a, b, c = place.position
        self._world.push(*link, into_world(turn, push.force), into_world(turn, push.torque), (a + x, b + y, c + z))
