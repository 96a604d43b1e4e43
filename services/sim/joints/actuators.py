"""The joints of one model that obey efforts: the jobs that are on them, and what they come to at each step."""

from __future__ import annotations

from math import inf

from messages.joints import JointEffort
from models.limits import Limits
from services.runtime.errors import BadInput, unknown
from services.runtime.inputs import Input
from services.runtime.log import Log
from services.runtime.network.wire import MEMBER_BYTES
from services.runtime.service import STEP_NS
from services.sim.ages import Ages
from services.sim.joints.effort import Rule, total
from services.sim.joints.jobs import Jobs, schedule
from services.sim.physics.world import World

GRACE_S = 0.25
"""How late, in simulation time, a job from the topic may come that is shorter than this or has no end."""
AHEAD_S = 1.0
"""How far ahead a job from the topic may start: one that starts later was made before time was set back."""


class Actuators:
    """Takes jobs from the topic and from requests; ``applied`` is what acted in the last step, N m or N."""

    def __init__(self, world: World, name: str, limits: dict[str, Limits], rule: Rule, ages: Ages, log: Log) -> None:
        self.rule, self.limits = rule, limits
        self._world, self._name, self._ages, self._log = world, name, ages, log
        self._jobs: dict[str, Jobs[float]] = {joint: Jobs() for joint in world.joints(name)}
        self.stopped = False
        self.restart()

    def restart(self) -> None:
        """Drop all jobs."""
        for jobs in self._jobs.values():
            jobs.clear()
        self.applied = dict.fromkeys(self._jobs, 0.0)

    def obey(self, topic: Input[JointEffort], now: int, governed: set[bytes], factor: float) -> None:
        """Take the jobs that the topic admitted at ``now`` [ns]; what is refused counts as refused in its health.

        Publishers in lockstep (``governed``, ids of members) are on time by construction; the age of all other jobs is
        measured in wall time, turned into simulation time by ``factor``, and goes off their duration: what waited in a
        frozen process is over, or ends when it would have ended.
        """
        for job, origin in topic.batch if not self.stopped else ():
            age, source = 0.0, b""
            if origin is not None:
                source = origin.publisher
                if source[:MEMBER_BYTES] not in governed:
                    age = self._ages.of(origin)
                    age = age * factor if age < inf else inf
            try:
                self._check(job, now, age)
                self._add(job, job.duration if job.duration < 0 else max(0.0, job.duration - age), now, source)
            except BadInput as error:
                topic.refuse(str(error))
                self._log.warn(f"{topic.name}: {error}", every=1.0)

    def stop(self, on: bool) -> None:
        """Drop all jobs, as Gazebo's effort joints get 0, and keep none that comes, or take jobs again."""
        if on and not self.stopped:
            self.restart()
        self.stopped = on

    def apply(self, job: JointEffort, now: int) -> str:
        """Take a job at ``now`` [ns]; returns the note on its duration. Raises BadInput for a joint there is not."""
        if self.stopped:
            raise BadInput(f"{self._name} is stopped: e_stop = false of each who stopped it resets it")
        return self._add(job, job.duration, now, b"")

    def clear(self, joint: str) -> int:
        """Drop the jobs of a joint; returns how many."""
        return self.jobs(joint).clear()

    def lost(self, source: bytes) -> None:
        """A publisher is gone: its jobs end when they end, and now if they have no end."""
        for jobs in self._jobs.values():
            jobs.lost(source)

    def jobs(self, joint: str) -> Jobs[float]:
        """The jobs of a joint; raises BadInput with the joints that there are."""
        if joint not in self._jobs:
            raise unknown("joint", joint, self._jobs, self._name)
        return self._jobs[joint]

    def step(self, now: int) -> None:
        """Put on the joints what acts in the step that begins at ``now`` [ns]."""
        acting = {joint: self._acting(jobs, now) for joint, jobs in self._jobs.items() if jobs}
        if not any(acting.values()):
            if any(self.applied.values()):
                self.applied = dict.fromkeys(self._jobs, 0.0)
            return
        rates = dict(zip(self._jobs, self._world.joint_readings(self._name).velocity, strict=True))
        efforts = {
            joint: total(self.rule, self.limits[joint], rates[joint], values)
            for joint, values in acting.items()
            if values
        }
        self._world.set_efforts(self._name, efforts)
        self.applied = dict.fromkeys(self._jobs, 0.0) | efforts

    def _add(self, job: JointEffort, duration: float, now: int, source: bytes) -> str:
        jobs = self.jobs(job.joint_name)
        made, note = schedule(job.effort, job.start_time.ns, duration, now, STEP_NS, source)
        jobs.add(made)
        return note

    def _acting(self, jobs: Jobs[float], now: int) -> list[float]:
        return jobs.all(now) if self.rule.mode == "sum" else jobs.last(now)

    def _check(self, job: JointEffort, now: int, age: float) -> None:
        """Raise BadInput for a job that is over, or that starts too far ahead."""
        start = job.start_time.ns
        if start > now + AHEAD_S * 1e9:
            raise BadInput(
                f"a job that starts {(start - now) / 1e9:.3f} s ahead, at {start / 1e9:.3f} s, is dropped: "
                f"on the topic {AHEAD_S:g} s is the most, as time may have been set back (/sim/apply_effort takes any)"
            )
        if start and job.duration >= 0:
            age = max(age, (now - start) / 1e9)
        if age == inf:
            raise BadInput(
                "a job is dropped that is newer by its stamp than any before could be: the clock of its sender's "
                "machine was set ahead, or differs"
            )
        if age > max(job.duration, GRACE_S):
            raise BadInput(f"a job of {job.duration:g} s that was made {age:.3f} s ago is dropped: its time is over")
