"""An intermittent processor load."""

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
"""Wall time for which a load process is busy, and then sleeps: a dozen ticks of a controller."""


@contextmanager
def cpu_load(count: int) -> Iterator[None]:
    """Run ``count`` load processes during the block, busy every other BURST_S. Each has a session of its own, since
    Linux shares processor time by session. An intermittent load disturbs scheduling more than a constant one.
    """
    with ExitStack() as stack:
        for _ in range(count):
            command = [sys.executable, "-c", _BUSY.format(burst_s=BURST_S)]
            hog = stack.enter_context(subprocess.Popen(command, start_new_session=True))
            stack.callback(hog.kill)
        yield
