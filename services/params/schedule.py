"""Changes that a fleet file has scheduled: each is due once in a run, at the first tick at or after its time."""

from __future__ import annotations

import os
from collections.abc import Collection, Container, Sequence
from pathlib import Path

from services.params import Scheduled
from services.runtime.process import PARENT


class Schedule:
    """What is still to come, by time, then in the order of the file. ``done`` are the numbers of the others."""

    def __init__(self, changes: Sequence[Scheduled]) -> None:
        self._all = sorted(changes, key=lambda each: each.at)
        self.done: frozenset[int] = frozenset()

    def start(self, done: Collection[int] = ()) -> None:
        """A new run: everything is to come again, but for what this run has had before the service was restarted."""
        self.done = frozenset(done)

    def pop_due(self, now_ns: int, sets: Container[str]) -> dict[int, Scheduled]:
        """Take what is due at simulation time ``now_ns`` for ``sets`` that are there, by its number in the order of the
        times; the rest waits for its set."""
        ready = {i: each for i, each in self._pending().items() if each.set in sets and round(each.at * 1e9) <= now_ns}
        self.done |= ready.keys()
        return ready

    def overdue(self, now_ns: int, patience_ns: int) -> list[Scheduled]:
        """What has waited for its set for longer than ``patience_ns``."""
        return [each for each in self._pending().values() if round(each.at * 1e9) + patience_ns <= now_ns]

    def _pending(self) -> dict[int, Scheduled]:
        return {i: each for i, each in enumerate(self._all) if i not in self.done}


def run_id() -> str:
    """What tells one run of a supervisor from all others, or nothing for a service that was started by hand."""
    parent = os.environ.get(PARENT, "")
    try:
        # The start of the process, behind its name, which may have spaces: proc(5).
        began = Path(f"/proc/{int(parent)}/stat").read_text().rpartition(")")[2].split()[19]
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except (OSError, ValueError, IndexError):
        return ""
    return f"{boot} {parent} {began}"
