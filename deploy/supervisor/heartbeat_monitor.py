"""Decides when a process counts as hung: its heartbeat deadline, extended by the time it waited for a CPU."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from services.runtime.heartbeat import PERIOD_S

_RUNNABLE_STATES = "RD"
"""States of a thread that wants to run: running, waiting for a CPU, or waiting for the disk."""


class ThreadTimes(NamedTuple):
    """The kernel's counters of a thread: time [ns] on a CPU and waiting for one, and whether it is runnable.

    A wait is counted only when it ends; one in progress shows as a runnable thread that does not run.
    """

    ran: int
    waited: int
    runnable: bool


Threads = Mapping[int, ThreadTimes]
"""The threads of a process by id; empty if the kernel does not report them."""


def cpu_wait(before: Threads, after: Threads, elapsed: float) -> float:
    """Return how long [s] a thread of a process waited for a CPU in the ``elapsed`` [s] between two samples.

    The threads of a service depend on each other, so the longest wait counts. A thread that sleeps, waits for a lock,
    or runs is not held up.
    """
    longest = 0.0
    for number, now in after.items():
        if (then := before.get(number)) is None:
            continue
        waited = (now.waited - then.waited) / 1e9
        if then.runnable and now.runnable:
            waited = max(waited, elapsed - (now.ran - then.ran) / 1e9)
        longest = max(longest, waited)
    return min(longest, elapsed)


class CpuWaitMeter:
    """Samples the CPU waits of related processes repeatedly."""

    def __init__(self) -> None:
        self._pids: Sequence[int] = ()
        self._last: tuple[float, list[Threads]] | None = None

    def measure(self, now: float) -> float:
        """Return the longest time [s] one of them waited for a CPU between the last sample and
        ``now`` [s]; 0 at first.
        """
        seen = [read_threads(each) for each in self._pids]
        last, self._last = self._last, (now, seen)
        if last is None or not seen:
            return 0.0
        return max(cpu_wait(before, after, now - last[0]) for before, after in zip(last[1], seen, strict=True))

    def reset(self, *pids: int) -> None:
        """Discard the last sample; the next one is the first, of these processes."""
        self._pids, self._last = pids, None


def read_threads(pid: int) -> Threads:
    """Return the current threads of a process; empty if it has ended, or the kernel does not report them (``proc(5)``).

    The calling thread is never reported as runnable: it is running, and its waits have ended and are counted.
    """
    folder, mine = f"/proc/{pid}/task", threading.get_native_id()
    try:
        numbers = os.listdir(folder)
    except OSError:
        return {}
    found = {}
    for number in numbers:
        try:
            ran, waited, _ = _read(f"{folder}/{number}/schedstat").split()
            state = _read(f"{folder}/{number}/stat").rpartition(") ")[2][:1]
        except (OSError, ValueError):
            continue
        found[int(number)] = ThreadTimes(int(ran), int(waited), state in _RUNNABLE_STATES and int(number) != mine)
    return found


def _read(path: str) -> str:
    with open(path, encoding="ascii", errors="replace") as file:
        return file.read()


MISSED_HEARTBEATS = 3
HEARTBEAT_TIMEOUT_S = MISSED_HEARTBEATS * PERIOD_S
"""Wall time without a heartbeat after which a process counts as hung."""

STARTUP_TIMEOUT_S = 20.0
"""Wall time that a process has until its first heartbeat: imports, models and links, on a busy machine."""

CPU_WAIT_CHECK_S = HEARTBEAT_TIMEOUT_S / 2
"""Wall time before that deadline at which CPU waits start to be sampled."""

RECOVERY_S = 3.0
"""Wall time within which heartbeats must resume after the process or link that carries them was down."""


class HeartbeatMonitor:
    """The heartbeats of one run of a process, on a clock [s] that the caller reads."""

    def __init__(self, now: float, grace: float = STARTUP_TIMEOUT_S) -> None:
        self.received = False
        self.cpu_wait_s = 0.0
        """Time [s] of the present silence in which it waited for a CPU, as far as that was sampled."""
        self._last, self._deadline = now, now + grace

    def on_heartbeat(self, now: float) -> None:
        """Record a heartbeat."""
        self.received, self.cpu_wait_s = True, 0.0
        self._last, self._deadline = now, now + HEARTBEAT_TIMEOUT_S

    def extend_to(self, now: float, seconds: float = RECOVERY_S) -> None:
        """Extend the deadline to at least ``seconds`` from now, since the silence is not the process's fault."""
        self._deadline = max(self._deadline, now + seconds)

    def extend_by(self, seconds: float) -> None:
        """Extend the deadline by ``seconds`` in which the process could not publish a heartbeat."""
        self.cpu_wait_s += seconds
        self._deadline += seconds

    def is_late(self, now: float) -> bool:
        """Return whether the silence is long enough to start sampling CPU waits."""
        return now > self._deadline - self.cpu_wait_s - CPU_WAIT_CHECK_S

    def is_healthy(self, now: float) -> bool:
        """Return whether heartbeats arrive, at most one period late."""
        return self.received and now - self._last < 2 * PERIOD_S

    def is_hung(self, now: float) -> bool:
        """Return whether the deadline of the next heartbeat has passed."""
        return now > self._deadline

    def silence(self, now: float) -> float:
        """Return the time [s] since the last heartbeat, or since the start."""
        return now - self._last
