"""Imports PyBullet without its output."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

__all__ = ["pybullet", "stdout_to_stderr"]


def stdout_to_stderr() -> AbstractContextManager[None]:
    """Redirect what C code prints from the standard output to the standard error.

    PyBullet prints about problems of a URDF, and a service's standard output belongs to its reader.
    """
    return _redirected(1, 2)


@contextmanager
def _redirected(source: int, target: int) -> Iterator[None]:
    """Redirect what C code writes from one file descriptor to another."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    kept = os.dup(source)
    os.dup2(target, source)
    try:
        yield
    finally:
        flush(None)
        os.dup2(kept, source)
        os.close(kept)


with open(os.devnull, "wb") as _nowhere, _redirected(2, _nowhere.fileno()), _redirected(1, _nowhere.fileno()):
    import pybullet  # prints its build time
