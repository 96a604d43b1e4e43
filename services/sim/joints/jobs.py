"""Jobs: values that act from one simulation time to another, and which of them act now."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Generic, TypeVar

from services.runtime.errors import BadInput

T = TypeVar("T")

MAX_JOBS = 1000
"""Jobs that one joint or body keeps; a controller at 1 kHz with jobs of 0.1 s has 101."""


@dataclass(frozen=True)
class Job(Generic[T]):
    """``value`` acts on every physics step that begins at ``start`` <= time <= ``end`` [ns].

    ``end`` is inf for a job that lasts until it is cleared. ``source`` is the publisher, empty for a request.
    """

    value: T
    start: int
    end: float
    source: bytes = b""


def schedule_job(
    value: T, start_ns: int, duration: float, now_ns: int, step_ns: int, source: bytes = b""
) -> tuple[Job[T], str]:
    """The job, and a note where it acts otherwise than its ``duration`` [s] says.

    A start in the past is now. A negative duration lasts until the job is cleared. Every job acts on one step at least,
    also where none begins between its start and its end: so Gazebo's code does, though its documentation has a duration
    of 0 do nothing.
    """
    start = max(start_ns, now_ns)
    if duration < 0:
        return Job(value, start, inf, source), "until it is cleared"
    span = round(duration * 1e9)
    note = "" if span >= step_ns else f"for one physics step of {step_ns / 1e6:g} ms, the shortest there is"
    first = -(-start // step_ns) * step_ns
    return Job(value, start, max(start + span, first), source), note


class JobQueue(Generic[T]):
    """The jobs of one joint or body, in the order in which they begin."""

    def __init__(self) -> None:
        self._jobs: list[Job[T]] = []

    def __len__(self) -> int:
        return len(self._jobs)

    def add(self, job: Job[T]) -> None:
        """Take a job; raises BadInput when there are too many. Among those of one start, the last to come is later."""
        if len(self._jobs) >= MAX_JOBS:
            raise BadInput(f"{MAX_JOBS} jobs are waiting or acting, which is the limit: clear some first")
        place = len(self._jobs)
        while place and self._jobs[place - 1].start > job.start:
            place -= 1
        self._jobs.insert(place, job)

    def clear(self) -> int:
        """Drop all; returns how many."""
        count = len(self._jobs)
        self._jobs.clear()
        return count

    def publisher_lost(self, source: bytes) -> None:
        """A publisher is gone: its jobs that last until cleared end now, the others at their own end."""
        self._jobs = [job for job in self._jobs if job.source != source or job.end < inf]

    def active(self, now: int) -> list[T]:
        """What acts on the step that begins at ``now`` [ns]; jobs that are over are dropped."""
        if not self._jobs:
            return []
        self._jobs = [job for job in self._jobs if now <= job.end]
        return [job.value for job in self._jobs if job.start <= now]

    def latest(self, now: int) -> list[T]:
        """As ``all``, but only the job that began last acts; those that began before it are dropped with it."""
        if not self._jobs:
            return []
        begun = [job for job in self._jobs if job.start <= now]
        if not begun:
            return []
        newest = begun[-1]
        acting = now <= newest.end
        self._jobs = ([newest] if acting else []) + self._jobs[len(begun) :]
        return [newest.value] if acting else []
