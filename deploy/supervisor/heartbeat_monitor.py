"""Decides when a process counts as hung: the deadline of its next heartbeat, extended by its waits for a CPU."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from typing import NamedTuple

from services.runtime.heartbeat import PERIOD_S

_RUNNABLE_STATES = "RD"
"""States of a thread that would go on if the machine let it: it runs or waits for a processor, or for the disk."""


class ThreadTimes(NamedTuple):
    """The kernel's counts of a thread: time [ns] on a CPU and waiting for one, and whether it is runnable.

    A wait is counted when it ends. A lasting one shows as a runnable thread that does not run.
    """

    ran: int
    waited: int
    runnable: bool


Threads = Mapping[int, ThreadTimes]
"""The threads of a process by their ids; empty if the kernel does not report them."""


def cpu_wait(before: Threads, after: Threads, elapsed: float) -> float:
    """The part [s] of the time ``elapsed`` [s] between two looks in which a thread of a process waited for a CPU.

    The threads of a service need each other, so the one that waited longest counts. A thread that sleeps, waits for a
    lock, or runs is not held up.
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
    """Looks at some processes that belong together again and again."""

    def __init__(self, *pids: int) -> None:
        self._pids = pids
        self._last: tuple[float, list[Threads]] | None = None

    def measure(self, now: float) -> float:
        """For how long [s] any of them was held up since the last look at time ``now`` [s]; 0 at the first."""
        seen = [read_threads(each) for each in self._pids]
        last, self._last = self._last, (now, seen)
        if last is None:
            return 0.0
        return max(cpu_wait(before, after, now - last[0]) for before, after in zip(last[1], seen, strict=True))

    def reset(self) -> None:
        """The next look is the first again."""
        self._last = None


def read_threads(pid: int) -> Threads:
    """The current threads of a process; empty if it has ended, or the kernel does not report them (see ``proc(5)``).

    The calling thread always appears as running; its waits have ended and are counted.
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
"""Wall time without a heartbeat after which a process hangs."""

STARTUP_TIMEOUT_S = 20.0
"""Wall time that a process has for its first heartbeat: imports, models and links, on a busy machine."""

CPU_WAIT_CHECK_S = HEARTBEAT_TIMEOUT_S / 2
"""Wall time before that limit from which on it is looked at why no heartbeat comes."""

RECOVERY_S = 3.0
"""Wall time in which heartbeats must come again after what carries them was down."""


class HeartbeatMonitor:
    """One life's heartbeats, on a clock that the caller reads [s]."""

    def __init__(self, now: float, grace: float = STARTUP_TIMEOUT_S) -> None:
        self.received = False
        self.cpu_wait_s = 0.0
        """Time [s] of the present silence in which it could not beat, as far as it was looked at."""
        self._last, self._deadline = now, now + grace

    def on_heartbeat(self, now: float) -> None:
        """A heartbeat has come."""
        self.received, self.cpu_wait_s = True, 0.0
        self._last, self._deadline = now, now + HEARTBEAT_TIMEOUT_S

    def extend_to(self, now: float, seconds: float = RECOVERY_S) -> None:
        """Silence is not its fault at present: it has ``seconds`` from now."""
        self._deadline = max(self._deadline, now + seconds)

    def extend_by(self, seconds: float) -> None:
        """For ``seconds`` it could not beat, whatever it did: they do not count."""
        self.cpu_wait_s += seconds
        self._deadline += seconds

    def is_late(self, now: float) -> bool:
        """Whether it is time to look for the reason of its silence."""
        return now > self._deadline - self.cpu_wait_s - CPU_WAIT_CHECK_S

    def is_healthy(self, now: float) -> bool:
        """Whether it beats, at most one beat late."""
        return self.received and now - self._last < 2 * PERIOD_S

    def is_hung(self, now: float) -> bool:
        """Whether the next heartbeat is overdue."""
        return now > self._deadline

    def silence(self, now: float) -> float:
        """Time since the last heartbeat, or since the start [s]."""
        return now - self._last
