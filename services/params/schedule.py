"""Scheduled parameter changes of a fleet: each is due once in a run, at the first tick at or after its time."""

from __future__ import annotations

from collections.abc import Collection, Container, Sequence
from pathlib import Path

import msgspec

from messages.parameters import ScheduledChanges
from services.params import Scheduled
from services.runtime.atomic_file import write_atomic

MAX_FILE_BYTES = 8 << 20
"""Maximum bytes read from a progress file; a longer one is not ours."""


class Schedule:
    """The changes in the order of their times, then of the fleet file; ``done`` has the numbers of those once due."""

    def __init__(self, changes: Sequence[Scheduled]) -> None:
        self._all = sorted(changes, key=lambda each: each.at)
        self.done: frozenset[int] = frozenset()

    def start(self, done: Collection[int] = ()) -> None:
        """Begin a run; the changes ``done`` were due before a restart of this service."""
        self.done = frozenset(done)

    def pop_due(self, now_ns: int, sets: Container[str]) -> dict[int, Scheduled]:
        """Return the changes of the announced ``sets`` due at simulation time ``now_ns`` by number, each only once."""
        ready = {i: each for i, each in self._pending().items() if each.set in sets and round(each.at * 1e9) <= now_ns}
        self.done |= ready.keys()
        return ready

    def overdue(self, now_ns: int, patience_ns: int) -> list[Scheduled]:
        """Return the changes that have waited for their set for ``patience_ns`` or longer."""
        return [each for each in self._pending().values() if round(each.at * 1e9) + patience_ns <= now_ns]

    def _pending(self) -> dict[int, Scheduled]:
        return {i: each for i, each in enumerate(self._all) if i not in self.done}


def read_progress(file: Path) -> ScheduledChanges:
    """Read the scheduled changes made before a restart; raises OSError or msgspec.MsgspecError."""
    try:
        with file.open("rb") as source:
            return msgspec.json.decode(source.read(MAX_FILE_BYTES), type=ScheduledChanges)
    except FileNotFoundError:
        return ScheduledChanges()


def write_progress(file: Path, progress: ScheduledChanges) -> None:
    """Save the scheduled changes made so far, for a restart; raises OSError."""
    write_atomic(file, msgspec.json.encode(progress), durable=True)
