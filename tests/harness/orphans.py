"""Kills the processes that a test run leaves behind, however the run ends: it briefly outlives the run.

Background fleets have no parent, and a killed run tears nothing down. All processes that tests start inherit their
environment, and with it the mark of the run. Run as a script: it must start fast and imports nothing of the project.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

MARK = "ELEA_TEST_RUN"
"""Environment variable with the mark of the test run."""

_ROUNDS, _PAUSE_S = 50, 0.1
"""Several rounds, because a process that is just being started is found only in the next one."""


@contextmanager
def no_orphans() -> Iterator[None]:
    """Kill all that is started in the block, directly or indirectly, soon after the block or this process ends."""
    mark = uuid.uuid4().hex
    command = [sys.executable, "-I", "-S", __file__, mark]
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as killer:
        before = os.environ.get(MARK)
        os.environ[MARK] = mark
        try:
            yield
        finally:
            os.environ.pop(MARK)
            if before is not None:
                os.environ[MARK] = before
            assert killer.stdin is not None
            killer.stdin.close()


def _marked(mark: str) -> Iterator[int]:
    """Yield the ids of processes with this mark; zombies have none."""
    for each in Path("/proc").iterdir():
        with suppress(OSError):  # ended, or another user's
            if each.name.isdigit() and mark.encode() in (each / "environ").read_bytes().split(b"\0"):
                yield int(each.name)


def _main(mark: str) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    sys.stdin.read()
    for _ in range(_ROUNDS):
        found = list(_marked(f"{MARK}={mark}"))
        for each in found:
            with suppress(ProcessLookupError):
                os.kill(each, signal.SIGKILL)
        if not found:
            return
        time.sleep(_PAUSE_S)


if __name__ == "__main__":
    _main(sys.argv[1])
