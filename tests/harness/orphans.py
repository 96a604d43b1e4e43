"""Kills what a test run has started and left behind, however the run ends: it outlives the run by a moment.

Fleets in the background belong to no parent, and a run that is killed tears nothing down. All that tests start inherits
their environment, and in it the mark of the run. Run as a script: it must start fast and needs nothing of the project.
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
"""Environment variable that holds the mark."""

_ROUNDS, _PAUSE_S = 50, 0.1
"""A process that is being started is seen in the next round."""


@contextmanager
def no_orphans() -> Iterator[None]:
    """Whatever is started in the block, and by it, is gone soon after its end, and after that of this process."""
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
    """The processes with this mark; a zombie has none."""
    for each in Path("/proc").iterdir():
        with suppress(OSError):  # it has ended, or is another user's
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
