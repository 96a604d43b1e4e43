"""Programs that take processor time from all others, intermittently."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

_BUSY = """
import time
while True:
    end = time.monotonic() + {burst_s}
    while time.monotonic() < end:
        pass
    time.sleep({burst_s})
"""
BURST_S = 0.05
"""Wall time for which a process is busy, and then waits: a dozen ticks of a controller."""


@contextmanager
def cpu_load(count: int) -> Iterator[None]:
    """So many processes beside the block that are busy every other BURST_S, each in a session of its own: Linux shares
    time out by sessions. A load that comes and goes upsets the order of others more than one that stays.
    """
    with ExitStack() as stack:
        for _ in range(count):
            command = [sys.executable, "-c", _BUSY.format(burst_s=BURST_S)]
            hog = stack.enter_context(subprocess.Popen(command, start_new_session=True))
            stack.callback(hog.kill)
        yield
