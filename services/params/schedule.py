"""Changes that a fleet file has scheduled: each is due once in a run, at the first tick at or after its time."""

from __future__ import annotations

from collections.abc import Container, Sequence

from services.params import Scheduled


class Schedule:
    """What is still to come, by time, then in the order of the file."""

    def __init__(self, changes: Sequence[Scheduled]) -> None:
        self._all = sorted(changes, key=lambda each: each.at)
        self._left = list(self._all)

    def start(self) -> None:
        """A new run: everything is to come again."""
        self._left = list(self._all)

    def due(self, now_ns: int, sets: Container[str]) -> list[Scheduled]:
        """Take what is due at simulation time ``now_ns`` for ``sets`` that are there; the rest waits for its set."""
        ready = [each for each in self._left if round(each.at * 1e9) <= now_ns and each.set in sets]
        self._left = [each for each in self._left if each not in ready]
        return ready

    def late(self, now_ns: int, patience_ns: int) -> list[Scheduled]:
        """What has waited for its set for longer than ``patience_ns``."""
        return [each for each in self._left if round(each.at * 1e9) + patience_ns <= now_ns]
