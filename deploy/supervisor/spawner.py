"""Starts a process in its own group; its log, signals and exit."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from deploy.supervisor.log_file import ShowLine, log_name, start_log_writer
from deploy.supervisor.reaper import Reaper
from services.runtime.process import PARENT, ROOT

_LOG_TIMEOUT_S = 3.0
"""Wall time [s] to wait for the rest of the log of a process that has ended."""


class ChildProcess:
    """A running process; its starter awaits ``wait``, which also kills the rest of its process group."""

    def __init__(self, popen: subprocess.Popen[bytes], reaper: Reaper, log: threading.Thread) -> None:
        self.pid = popen.pid
        self.status: int | None = None
        self._popen, self._reaper, self._log = popen, reaper, log
        reaper.watch(self.pid)

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the whole group while it exists."""
        if self.status is None:
            os.killpg(self.pid, number)

    async def wait(self) -> int:
        """Wait for the exit; return its status, negative for a signal."""
        if self.status is None:
            await _wait_for_exit(self.pid)
            os.killpg(self.pid, signal.SIGKILL)
            self.status = self._popen.wait()
            self._reaper.forget(self.pid)
            await self._wait_for_log()
        return self.status

    async def wait_for(self, seconds: float) -> bool:
        """Wait at most ``seconds`` for the exit; return whether it came."""
        try:
            await asyncio.wait_for(self.wait(), seconds)
        except TimeoutError:
            return False
        return True

    async def _wait_for_log(self) -> None:
        """Wait until its last output is in the log; another process may keep the pipe open for longer."""
        deadline = time.monotonic() + _LOG_TIMEOUT_S
        while self._log.is_alive() and time.monotonic() < deadline:
            await asyncio.sleep(0.005)


class Spawner:
    """Starts child processes with the run's folder, their logs and their environment variables."""

    def __init__(
        self,
        folder: Path,
        reaper: Reaper,
        environment: Mapping[str, str] = os.environ,
        show: ShowLine | None = None,
    ) -> None:
        self.folder, self._reaper, self._show = folder, reaper, show
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

    def log_path(self, name: str) -> Path:
        """Return the path of a process's log file."""
        return self.logs / log_name(name)

    def spawn(
        self,
        name: str,
        argv: Sequence[str],
        environment: Mapping[str, str] | None = None,
        cwd: str = "",
        screen: bool = False,
    ) -> ChildProcess:
        """Start a process in a session and group of its own.

        Call this from the main thread: the kernel binds PR_SET_PDEATHSIG to the thread that forks.

        Args:
            name: Of the process and its log.
            argv: The command line.
            environment: Additional variables.
            cwd: The working directory; the run's folder if empty.
            screen: Whether to show its lines, too.

        Raises:
            OSError: The process cannot be started.
        """
        out, into = os.pipe()
        try:
            popen = subprocess.Popen(
                argv,
                stdin=subprocess.DEVNULL,
                stdout=into,
                stderr=subprocess.STDOUT,
                env={**self._environment, **(environment or {})},
                cwd=cwd or self.folder,
                start_new_session=True,
            )
        except OSError:
            os.close(out)
            raise
        finally:
            os.close(into)
        show = self._show if screen else None
        writer = start_log_writer(out, self.log_path(name), show=partial(_show_of, name, show) if show else None)
        return ChildProcess(popen, self._reaper, writer)


def _show_of(name: str, show: ShowLine, line: str) -> None:
    show(f"{name}: {line}")


async def _wait_for_exit(pid: int) -> None:
    """Wait until a child has exited, without reaping it: until then its process and group ids are not reused."""
    loop = asyncio.get_running_loop()
    gone = asyncio.Event()
    descriptor = os.pidfd_open(pid)
    loop.add_reader(descriptor, gone.set)
    try:
        await gone.wait()
    finally:
        loop.remove_reader(descriptor)
        os.close(descriptor)
