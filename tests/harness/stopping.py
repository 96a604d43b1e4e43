"""Stops processes, so that a test knows that they do nothing more."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from pathlib import Path

from tests.harness.waiting import wait_until

STOPPED = "T"
"""The state of a stopped thread in ``/proc``."""


def stop_process(pid: int) -> None:
    """Stop a process with SIGSTOP and wait until each of its threads stands still.

    One of them takes the signal and stops the others, which go on until then: for 18 ms on a busy machine.
    """
    os.kill(pid, signal.SIGSTOP)
    wait_until(lambda: _states(pid) == {STOPPED}, 20.0, "a process that stands still")


def _states(pid: int) -> set[str]:
    states: set[str] = set()
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with suppress(FileNotFoundError):  # a thread that has just ended
            states.add((thread / "stat").read_text().rpartition(")")[2].split()[0])
    return states
