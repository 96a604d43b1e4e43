"""Jobs: values that act during an interval of simulation time, and the queue of those on one joint or body."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Generic, TypeVar

from services.runtime.errors import BadInput

T = TypeVar("T")

MAX_JOBS = 1000
"""Maximum number of jobs on one joint or body; a controller at 1 kHz with jobs of 0.1 s has 101."""


@dataclass(frozen=True)
class Job(Generic[T]):
    """``value`` acts on every physics step that begins at ``start`` <= time <= ``end`` [ns].

    ``end`` is inf for a job that lasts until it is cleared. ``source`` is the publisher id, empty for a request.
    """

    value: T
    start: int
    end: float
    source: bytes = b""


def schedule_job(
    value: T, start_ns: int, duration: float, now_ns: int, step_ns: int, source: bytes = b""
) -> tuple[Job[T], str]:
    """Return the job, and a note if it acts for another time than its ``duration`` [s].

    A start in the past becomes now. A negative duration lasts until the job is cleared. Every job acts on at least one
    step, even if none begins between its start and its end, as in Gazebo's code (its documentation has a duration of 0
    do nothing).
    """
    start = max(start_ns, now_ns)
    if duration < 0:
        return Job(value, start, inf, source), "until it is cleared"
    span = round(duration * 1e9)
    note = "" if span >= step_ns else f"for one physics step of {step_ns / 1e6:g} ms, the shortest there is"
    first = -(-start // step_ns) * step_ns
    return Job(value, start, max(start + span, first), source), note


class JobQueue(Generic[T]):
    """The jobs of one joint or body, ordered by start."""

    def __init__(self) -> None:
        self._jobs: list[Job[T]] = []

    def __len__(self) -> int:
        return len(self._jobs)

    def add(self, job: Job[T]) -> None:
        """Queue a job, after those with the same start; raises BadInput if MAX_JOBS are queued."""
        if len(self._jobs) >= MAX_JOBS:
            raise BadInput(f"{MAX_JOBS} jobs are waiting or acting, which is the limit: clear some first")
        index = len(self._jobs)
        while index and self._jobs[index - 1].start > job.start:
            index -= 1
        self._jobs.insert(index, job)

    def clear(self) -> int:
        """Drop all jobs; return how many."""
        count = len(self._jobs)
        self._jobs.clear()
        return count

    def publisher_lost(self, source: bytes) -> None:
        """After the loss of a publisher, end its jobs that last until cleared; the others keep their own end."""
        self._jobs = [job for job in self._jobs if job.source != source or job.end < inf]

    def active(self, now: int) -> list[T]:
        """Return the values that act on the step that begins at ``now`` [ns], and drop jobs that are over."""
        if not self._jobs:
            return []
        self._jobs = [job for job in self._jobs if now <= job.end]
        return [job.value for job in self._jobs if job.start <= now]

    def latest(self, now: int) -> list[T]:
        """As ``active``, but only the job that began last acts; those that began before it are dropped."""
        if not self._jobs:
            return []
        begun = [job for job in self._jobs if job.start <= now]
        if not begun:
            return []
        newest = begun[-1]
        acting = now <= newest.end
        self._jobs = ([newest] if acting else []) + self._jobs[len(begun) :]
        return [newest.value] if acting else []
