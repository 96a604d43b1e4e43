"""Process life cycle: end with the parent, with any thread, and on signals."""

from __future__ import annotations

import ctypes
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

from services.runtime.errors import BadInput

if TYPE_CHECKING:
    from typing_extensions import Buffer

ROOT = Path(__file__).resolve().parents[2]
"""The project's folder."""

PARENT = "ELEA_PARENT_PID"
"""Environment variable by which a supervisor asks its children not to outlive it."""

SWEEP = "ELEA_SWEEP_PID"
"""Like PARENT, set by a sweep for its runs, which are supervisors themselves."""

PROGRAM = "ELEA_PROGRAM"
"""Environment variable with the command that started the service, set by ``./elea run`` for the usage line."""

CLOSE_S = 5.0
"""Wall time [s] within which a process must leave the network after its loop has ended."""

_PR_SET_PDEATHSIG = 1
_DEAD_THREAD = 70


def check_import_roots() -> None:
    """Raise BadInput if a package of another project is imported under the name of one of ours."""
    for name in ("messages", "services", "models"):
        module = __import__(name)
        if Path(str(module.__file__)).resolve().parent != ROOT / name:
            raise BadInput(f"package {name!r} comes from {module.__file__}, not from {ROOT}: check PYTHONPATH")


def die_with_parent(variable: str = PARENT) -> None:
    """Have the kernel kill this process when its parent dies, if the environment ``variable`` has the parent's id.

    The variable is removed: child processes have another parent.
    """
    parent = os.environ.pop(variable, "")
    if not parent.isdigit():
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != int(parent):
        os._exit(_DEAD_THREAD)


def set_batch_scheduling() -> None:
    """Use batch scheduling, so that waking this process never preempts others: the simulation keeps its core."""
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def die_with_threads() -> None:
    """End the process, with the traceback, if any of its threads dies of an exception, including the main thread."""

    def report(dead: threading.ExceptHookArgs) -> None:
        name = dead.thread.name if dead.thread else "?"
        sys.stderr.write(f"thread {name} died; the process ends with it\n")
        traceback.print_exception(dead.exc_type, dead.exc_value, dead.exc_traceback)
        sys.stderr.flush()
        os._exit(_DEAD_THREAD)

    def report_main(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        traceback.print_exception(kind, error, trace)
        exit_now(1)

    threading.excepthook = report
    sys.excepthook = report_main


def lossy_stderr() -> None:
    """Ignore write errors on standard error, such as a closed pipe or a full disk: a lost message must not end the
    process.
    """
    if sys.stderr is None or sys.stderr is not sys.__stderr__:
        return
    sys.stderr = io.TextIOWrapper(
        io.BufferedWriter(_Lossy(2, "wb", closefd=False)), "utf-8", "backslashreplace", line_buffering=True
    )


class _Lossy(io.FileIO):
    """A file whose writes always succeed."""

    def write(self, data: Buffer, /) -> int:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def install_signal_handlers(stop: Callable[[], None]) -> None:
    """Call ``stop`` at SIGINT, SIGTERM and SIGHUP."""

    def handler(number: int, frame: FrameType | None) -> None:
        stop()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, handler)


def exit_now(status: int) -> None:
    """Exit at once, even if native threads are still running."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # its reader has closed it
            stream.flush()
    os._exit(status)


def exit_within(seconds: float, status: int) -> None:
    """Exit with ``status`` after ``seconds`` if the orderly shutdown hangs."""
    timer = threading.Timer(seconds, exit_now, (status,))
    timer.daemon = True
    timer.start()
