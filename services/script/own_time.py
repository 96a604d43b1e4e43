"""The time that the machine has left to a thread: on one that is busy it passes more slowly than the wall clock's."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path


class OwnTime:
    """Wall time since it was made, without that in which ``thread`` was ready to run and others had the processor.

    Args:
        thread: One of this process.
        now: The wall clock [s].
        delay: How long the thread has waited for a processor so far [s].
    """

    def __init__(
        self,
        thread: threading.Thread,
        now: Callable[[], float] = time.monotonic,
        delay: Callable[[threading.Thread], float] | None = None,
    ) -> None:
        self._thread, self._now, self._delay = thread, now, delay or run_delay
        self._began, self._delayed = self._now(), self._delay(thread)

    def exceeds(self, seconds: float) -> bool:
        """Whether more than that has passed."""
        elapsed = self._now() - self._began
        return elapsed > seconds and elapsed - (self._delay(self._thread) - self._delayed) > seconds


def run_delay(thread: threading.Thread) -> float:
    """How long a thread has waited for a processor so far [s]; 0 where the system does not tell, as Linux does."""
    try:
        return int(Path(f"/proc/self/task/{thread.native_id}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return 0.0
