"""A kernel on an in-memory network, to test a client library without a process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.script.api import set_kernel
from services.script.kernel import KernelOptions, ScriptKernel


@contextmanager
def memory_kernel(
    bus: MemoryBus | None = None, simulated: bool = False, install: bool = True
) -> Iterator[ScriptKernel]:
    """Yield a kernel on an in-memory network, which ``process.kernel()`` returns during the block.

    Args:
        bus: network that several kernels share; a new one by default.
        simulated: use the time given to ``kernel.clock.set``; wall time by default.
        install: whether ``process.kernel()`` returns it.
    """
    shared = bus or MemoryBus()
    made = ScriptKernel(lambda: MemoryTransport(shared), KernelOptions(simulated=simulated))
    if install:
        set_kernel(made)
    try:
        yield made
    finally:
        made.shut_down("the test is over")
        made.close()
        if install:
            set_kernel(None)
