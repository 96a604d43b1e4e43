"""One started process with its group: its log, its signals, its end."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from deploy.supervisor.log_file import log_name, pump
from deploy.supervisor.warden import Warden
from services.runtime.process import PARENT, ROOT

_LAST_WORDS_S = 0.5
"""Wall time in which the log of a process that has ended must be complete."""


class Child:
    """A running process; whoever starts it awaits ``ended``, which also ends what the process left in its group."""

    def __init__(self, popen: subprocess.Popen[bytes], warden: Warden, log: threading.Thread) -> None:
        self.pid = popen.pid
        self.status: int | None = None
        self._popen, self._warden, self._log = popen, warden, log
        warden.guard(self.pid)

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the whole group, as long as it exists."""
        if self.status is None:
            os.killpg(self.pid, number)

    async def ended(self) -> int:
        """Wait for the end; the exit status, negative for a signal."""
        if self.status is None:
            await _exit_of(self.pid)
            os.killpg(self.pid, signal.SIGKILL)
            self.status = self._popen.wait()
            self._warden.release(self.pid)
            await self._written()
        return self.status

    async def ended_within(self, seconds: float) -> bool:
        """Wait for the end, at most ``seconds``; whether it came."""
        try:
            await asyncio.wait_for(self.ended(), seconds)
        except TimeoutError:
            return False
        return True

    async def _written(self) -> None:
        """Wait until its last words are in the log; whoever else holds the pipe may keep it open for longer."""
        deadline = time.monotonic() + _LAST_WORDS_S
        while self._log.is_alive() and time.monotonic() < deadline:
            await asyncio.sleep(0.005)


class Nursery:
    """Where children are started: the folder of the run, with its logs, and the environment that they get."""

    def __init__(self, folder: Path, warden: Warden, environment: Mapping[str, str] = os.environ) -> None:
        self.folder, self._warden = folder, warden
        self.logs = folder / "logs"
        paths = [str(ROOT), *filter(None, [environment.get("PYTHONPATH")])]
        single = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._environment = {
            **single,
            **environment,
            "PYTHONPATH": os.pathsep.join(dict.fromkeys(paths)),
            "PYTHONUNBUFFERED": "1",
            PARENT: str(os.getpid()),
        }

    def log(self, name: str) -> Path:
        """The log file of a process."""
        return self.logs / log_name(name)

    def start(self, name: str, argv: Sequence[str]) -> Child:
        """Start a process in a session and group of its own; raises OSError. Call it from the main thread: the kernel
        binds PR_SET_PDEATHSIG to the thread that forks.
        """
        out, into = os.pipe()
        try:
            popen = subprocess.Popen(
                argv,
                stdin=subprocess.DEVNULL,
                stdout=into,
                stderr=subprocess.STDOUT,
                env=self._environment,
                cwd=self.folder,
                start_new_session=True,
            )
        except OSError:
            os.close(out)
            raise
        finally:
            os.close(into)
        return Child(popen, self._warden, pump(out, self.log(name)))


async def _exit_of(pid: int) -> None:
    """Wait until a child has ended, without reaping it: until then its number, and its group's, is its own."""
    loop = asyncio.get_running_loop()
    gone = asyncio.Event()
    descriptor = os.pidfd_open(pid)
    loop.add_reader(descriptor, gone.set)
    try:
        await gone.wait()
    finally:
        loop.remove_reader(descriptor)
        os.close(descriptor)
