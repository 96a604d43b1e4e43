"""PyBullet, imported without what it prints."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["pybullet", "stdout_to_stderr"]


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Send what C code prints to the standard output to the standard error: PyBullet prints when it is imported and
    when it dislikes a URDF, and a service's standard output belongs to its reader."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)


with stdout_to_stderr():
    import pybullet
