"""Programs that take all the processor time they get."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager


@contextmanager
def cpu_load(count: int) -> Iterator[None]:
    """So many busy processes beside the block, each in a session of its own: Linux shares time out by sessions."""
    with ExitStack() as stack:
        for _ in range(count):
            command = [sys.executable, "-c", "while True: pass"]
            hog = stack.enter_context(subprocess.Popen(command, start_new_session=True))
            stack.callback(hog.kill)
        yield
