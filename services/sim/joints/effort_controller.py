"""The effort controller of a model's joints: the jobs on them, and the effort that results at each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

from messages.joints import JointEffort
from models.urdf import JointLimits
from services.runtime.errors import BadInput, unknown_name
from services.runtime.log import Log
from services.runtime.step import STEP_NS
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import MEMBER_BYTES
from services.sim.joints.jobs import JobQueue, schedule_job
from services.sim.physics.world import BodyHandle
from services.sim.transit_delay import TransitDelayEstimator


@dataclass(frozen=True)
class EffortRule:
    """How efforts become one, in our way or in Gazebo's.

    ``mode``: ``replace`` lets the job act that began last, ``sum`` adds up all that act, as Gazebo does.
    ``clamp``: ``net_effort`` holds what acts to the URDF's effort limit, ``each`` every job by itself, as Gazebo does.
    ``velocity``: beyond the URDF's velocity limit, no effort acts along the motion. A limit of 0 is ``unspecified``, or
    it is a limit, as in Gazebo (``gazebo``): then effort acts on a joint at rest, or against its motion.
    """

    mode: Literal["replace", "sum"] = "replace"
    clamp: Literal["total", "each"] = "total"
    velocity: Literal["unspecified", "gazebo"] = "unspecified"


def net_effort(rule: EffortRule, limits: JointLimits, rate: float, efforts: Sequence[float]) -> float:
    """The effort [N m or N] on a joint that moves at ``rate`` [rad/s or m/s], from the efforts of the acting jobs.

    An effort limit of 0 leaves no effort at all, as in Gazebo.
    """
    if rule.clamp == "each":
        return sum(_clamp_effort(rule, limits, rate, effort) for effort in efforts)
    return _clamp_effort(rule, limits, rate, sum(efforts))


def _clamp_effort(rule: EffortRule, limits: JointLimits, rate: float, effort: float) -> float:
    fastest = limits.velocity
    if fastest is None or (fastest == 0 and rule.velocity == "unspecified"):
        fastest = inf
    if (rate > fastest and effort > 0) or (rate < -fastest and effort < 0):
        return 0.0
    most = inf if limits.effort is None else limits.effort
    return max(-most, min(most, effort))


MAX_LATENESS_S = 0.25
"""How late, in simulation time, a job from the topic may come that is shorter than this or has no end."""
LEAD_S = 1.0
"""How far ahead a job from the topic may start: one that starts later was made before time was set back."""


class JointEffortController:
    """Takes jobs from the topic and from requests; ``applied`` is what acted in the last step, N m or N."""

    def __init__(
        self,
        body: BodyHandle,
        name: str,
        limits: dict[str, JointLimits],
        rule: EffortRule,
        delays: TransitDelayEstimator,
        log: Log,
    ) -> None:
        self.effort_rule, self.limits = rule, limits
        self._body, self._name, self._delays, self._log = body, name, delays, log
        self._jobs: dict[str, JobQueue[float]] = {joint: JobQueue() for joint in body.joints}
        self.stopped = False
        self.reset()

    def reset(self) -> None:
        """Drop all jobs."""
        for jobs in self._jobs.values():
            jobs.clear()
        self.applied_efforts = dict.fromkeys(self._jobs, 0.0)

    def apply_commands(
        self, topic: Subscriber[JointEffort], now: int, lockstep_members: set[bytes], factor: float
    ) -> None:
        """Take the jobs that the topic admitted at ``now`` [ns]; what is refused counts as refused in its health.

        Publishers in lockstep (``lockstep_members``, ids of members) are on time by construction. The age of all other
        jobs is measured in wall time, turned into simulation time by ``factor`` and subtracted from their duration:
        what waited in a frozen process is over, or ends when it would have ended.
        """
        for job, origin in topic.messages if not self.stopped else ():
            age, source = 0.0, b""
            if origin is not None:
                source = origin.publisher
                if source[:MEMBER_BYTES] not in lockstep_members:
                    age = self._delays.estimate(origin)
                    age = age * factor if age < inf else inf
            try:
                self._check(job, now, age)
                self._add(job, job.duration if job.duration < 0 else max(0.0, job.duration - age), now, source)
            except BadInput as error:
                topic.reject(str(error))
                self._log.warn(f"{topic.name}: {error}", every=1.0)

    def stop(self, on: bool) -> None:
        """Drop all jobs, as Gazebo's effort joints get 0, and keep none that comes, or take jobs again."""
        if on and not self.stopped:
            self.reset()
        self.stopped = on

    def add_job(self, job: JointEffort, now: int) -> str:
        """Take a job at ``now`` [ns]; returns the note on its duration. Raises BadInput for a joint there is not."""
        if self.stopped:
            raise BadInput(f"{self._name} is stopped: each publisher that stopped it must send e_stop = false")
        return self._add(job, job.duration, now, b"")

    def clear_jobs(self, joint: str) -> int:
        """Drop the jobs of a joint; returns how many."""
        return self.jobs(joint).clear()

    def publisher_lost(self, source: bytes) -> None:
        """A publisher is gone: its jobs end when they end, and now if they have no end."""
        for jobs in self._jobs.values():
            jobs.publisher_lost(source)

    def jobs(self, joint: str) -> JobQueue[float]:
        """The jobs of a joint; raises BadInput with the joints that there are."""
        if joint not in self._jobs:
            raise unknown_name("joint", joint, self._jobs, self._name)
        return self._jobs[joint]

    def step(self, now: int) -> None:
        """Put on the joints what acts in the step that begins at ``now`` [ns]."""
        acting = {joint: self._active_efforts(jobs, now) for joint, jobs in self._jobs.items() if jobs}
        if not any(acting.values()):
            if any(self.applied_efforts.values()):
                self.applied_efforts = dict.fromkeys(self._jobs, 0.0)
            return
        rates = dict(zip(self._jobs, self._body.joint_readings().velocity, strict=True))
        efforts = {
            joint: net_effort(self.effort_rule, self.limits[joint], rates[joint], values)
            for joint, values in acting.items()
            if values
        }
        self._body.set_efforts(efforts)
        self.applied_efforts = dict.fromkeys(self._jobs, 0.0) | efforts

    def _add(self, job: JointEffort, duration: float, now: int, source: bytes) -> str:
        jobs = self.jobs(job.joint_name)
        made, note = schedule_job(job.effort, job.start_time.ns, duration, now, STEP_NS, source)
        jobs.add(made)
        return note

    def _active_efforts(self, jobs: JobQueue[float], now: int) -> list[float]:
        return jobs.active(now) if self.effort_rule.mode == "sum" else jobs.latest(now)

    def _check(self, job: JointEffort, now: int, age: float) -> None:
        """Raise BadInput for a job that is over, or that starts too far ahead."""
        start = job.start_time.ns
        if start > now + LEAD_S * 1e9:
            raise BadInput(
                f"a job that starts {(start - now) / 1e9:.3f} s ahead, at {start / 1e9:.3f} s, is dropped: "
                f"on the topic {LEAD_S:g} s is the most, as time may have been set back (/sim/apply_effort takes any)"
            )
        if start and job.duration >= 0:
            age = max(age, (now - start) / 1e9)
        if age == inf:
            raise BadInput(
                "a job is dropped that is newer by its stamp than any before could be: the clock of its sender's "
                "machine was set ahead, or differs"
            )
        if age > max(job.duration, MAX_LATENESS_S):
            raise BadInput(f"a job of {job.duration:g} s that was made {age:.3f} s ago is dropped: its time is over")
