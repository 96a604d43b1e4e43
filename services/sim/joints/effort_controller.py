"""The effort controller of a model's joints: the queued jobs, and the resulting effort at each step."""

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
    """The rule by which efforts are combined, in our way or in Gazebo's.

    ``mode``: with ``replace`` the job that began last acts, with ``sum`` all acting jobs add up, as in Gazebo.

    ``clamp``: the URDF's effort limit applies to the ``total`` effort, or to ``each`` job, as in Gazebo.

    ``velocity``: beyond the URDF's velocity limit, no effort acts along the motion. A limit of 0 counts as
    ``unspecified``, or as a limit, as in Gazebo (``gazebo``): then effort acts only on a joint at rest, or against its
    motion.
    """

    mode: Literal["replace", "sum"] = "replace"
    clamp: Literal["total", "each"] = "total"
    velocity: Literal["unspecified", "gazebo"] = "unspecified"


def net_effort(rule: EffortRule, limits: JointLimits, rate: float, efforts: Sequence[float]) -> float:
    """Return the effort [N m or N] on a joint moving at ``rate`` [rad/s or m/s], from those of the acting jobs.

    With an effort limit of 0 there is no effort at all, as in Gazebo.
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
"""Maximum lateness, in simulation time, of a job from the topic that is shorter than this or has no end."""
LEAD_S = 1.0
"""Maximum lead of a job from the topic: one that starts later was made before time was set back."""


class JointEffortController:
    """Applies jobs from the topic and from requests; ``applied_efforts`` acted in the last step, N m or N."""

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
        """Queue the jobs that the topic admitted at ``now`` [ns]; refused ones are counted in its health.

        Jobs of lockstep members (``lockstep_members``, ids of members) are on time by construction. The age of all
        others is measured in wall time, converted to simulation time by ``factor`` and subtracted from their duration:
        a job that waited in a frozen process is over, or ends when it would have ended.
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
        """Drop all jobs (Gazebo's effort joints get 0) and accept none; with ``on`` false, accept jobs again."""
        if on and not self.stopped:
            self.reset()
        self.stopped = on

    def add_job(self, job: JointEffort, now: int) -> str:
        """Queue a job at ``now`` [ns]; return the note on its duration.

        Raises:
            BadInput: The joint does not exist, the robot is stopped, or too many jobs are queued.
        """
        if self.stopped:
            raise BadInput(f"{self._name} is stopped: each publisher that stopped it must send e_stop = false")
        return self._add(job, job.duration, now, b"")

    def clear_jobs(self, joint: str) -> int:
        """Drop the jobs of a joint; return how many."""
        return self.jobs(joint).clear()

    def publisher_lost(self, source: bytes) -> None:
        """After the loss of a publisher, end its jobs that have no end of their own."""
        for jobs in self._jobs.values():
            jobs.publisher_lost(source)

    def jobs(self, joint: str) -> JobQueue[float]:
        """Return the jobs of a joint; raises BadInput with the joints available."""
        if joint not in self._jobs:
            raise unknown_name("joint", joint, self._jobs, self._name)
        return self._jobs[joint]

    def step(self, now: int) -> None:
        """Apply the efforts of the step that begins at ``now`` [ns]."""
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
        """Raise BadInput for a job that is over, or starts too far ahead."""
        start = job.start_time.ns
        if start > now + LEAD_S * 1e9:
            raise BadInput(
                f"a job that starts {(start - now) / 1e9:.3f} s ahead, at {start / 1e9:.3f} s, is dropped: "
                f"the limit on the topic is {LEAD_S:g} s, as time may have been reset (/sim/apply_effort has no limit)"
            )
        if start and job.duration >= 0:
            age = max(age, (now - start) / 1e9)
        if age == inf:
            raise BadInput(
                "a job is dropped, as its stamp is implausibly new: its sender's clock was set forward, or is not "
                "synchronised"
            )
        if age > max(job.duration, MAX_LATENESS_S):
            raise BadInput(f"a job of {job.duration:g} s sent {age:.3f} s ago is dropped: it has expired")
