"""The kernel of this process, for the imitated client libraries."""

from __future__ import annotations

from services.runtime.errors import EleaError
from services.script.api import Kernel


class NoKernel(EleaError):
    """A client library was imported in a process that runs no script."""


_kernel: Kernel | None = None


def kernel() -> Kernel:
    """The kernel of the script that this process runs; raises NoKernel in another process."""
    if _kernel is None:
        raise NoKernel("this process runs no script: start it with ./elea run FILE.py")
    return _kernel


def set_kernel(made: Kernel | None) -> None:
    """Let ``kernel`` return this one; for the start of a process, and for tests."""
    global _kernel
    _kernel = made
