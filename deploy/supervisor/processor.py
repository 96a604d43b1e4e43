"""Whether a process gets a processor: how long its threads waited for one, as the kernel tells."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from typing import NamedTuple

_READY = "RD"
"""States of a thread that would go on if the machine let it: it runs or waits for a processor, or for the disk."""


class Thread(NamedTuple):
    """What the kernel counts of a thread: time [ns] on a processor and in wait for one, and whether it wants to run.

    A wait is counted when it ends. One that lasts is seen by a thread that wants to run and does not.
    """

    ran: int
    waited: int
    wants: bool


Threads = Mapping[int, Thread]
"""The threads of a process by their numbers; empty where the kernel does not tell."""


def held_up(before: Threads, after: Threads, elapsed: float) -> float:
    """For how much of the time ``elapsed`` [s] between two looks a process was held up, at least one thread of it.

    The threads of a service need each other, so the one that waited longest counts. A thread that sleeps, that waits
    for a lock, or that has a processor for itself is not held up.
    """
    longest = 0.0
    for number, now in after.items():
        if (then := before.get(number)) is None:
            continue
        waited = (now.waited - then.waited) / 1e9
        if then.wants and now.wants:
            waited = max(waited, elapsed - (now.ran - then.ran) / 1e9)
        longest = max(longest, waited)
    return min(longest, elapsed)


class Look:
    """Looks at some processes that belong together again and again."""

    def __init__(self, *pids: int) -> None:
        self._pids = pids
        self._last: tuple[float, list[Threads]] | None = None

    def held_up(self, now: float) -> float:
        """For how long [s] any of them was held up since the last look at time ``now`` [s]; 0 at the first."""
        seen = [threads(each) for each in self._pids]
        last, self._last = self._last, (now, seen)
        if last is None:
            return 0.0
        return max(held_up(before, after, now - last[0]) for before, after in zip(last[1], seen, strict=True))

    def forget(self) -> None:
        """The next look is the first again."""
        self._last = None


def threads(pid: int) -> Threads:
    """The threads of a process now; empty when it has gone, or where the kernel does not tell (see ``proc(5)``).

    The thread that looks, runs as it does so: that tells nothing of it, but its waits have ended and are counted.
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
        found[int(number)] = Thread(int(ran), int(waited), state in _READY and int(number) != mine)
    return found


def _read(path: str) -> str:
    with open(path, encoding="ascii", errors="replace") as file:
        return file.read()
