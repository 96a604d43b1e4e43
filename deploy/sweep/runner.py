"""Runs the missing runs of a sweep, several at once, each as ``./elea up`` with its own folder, port and domain."""

from __future__ import annotations

import asyncio
import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from deploy import INTERRUPTED
from deploy.report.record import REPORT_FILE
from deploy.sweep.definition import Definition, Run
from deploy.sweep.results import RESULT_FILE, Result, read_result
from messages.base import DECODE_ERRORS
from services.runtime.atomic_file import write_atomic
from services.runtime.errors import BadInput
from services.runtime.fleet_instances import running_fleets
from services.runtime.process import SWEEP

DEFINITION_FILE = "sweep.json"
RUNS_FOLDER = "runs"
LOG_FILE = "up.log"
"""The output of ``up``, in the folder of a run."""
FIRST_PORT, LAST_PORT = 20_000, 29_999
"""Ports that identify the fleets of sweeps; nothing listens on them."""
_STOP_S = 60.0
"""Wall time to wait for the end of an interrupted run."""

Finished = Callable[[Run, Result], None]


@contextmanager
def open_folder(folder: Path, definition: Definition) -> Iterator[None]:
    """Begin a sweep in a folder, or resume the existing one, and lock it for this process.

    Raises:
        BadInput: Another sweep is there, or another process works on this one, or the folder cannot be written.
    """
    _begin(folder, definition)
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInput(f"another ./elea sweep is using {folder}: wait until it ends") from None
        yield
    finally:
        os.close(descriptor)


def _begin(folder: Path, definition: Definition) -> None:
    file = folder / DEFINITION_FILE
    try:
        if file.exists():
            if (known := read_definition(folder)) != definition:
                raise BadInput(f"{folder} holds another sweep: {_difference(known, definition)}; take another --report")
            return
        if folder.is_dir() and any(folder.iterdir()):
            raise BadInput(f"{folder} holds something other than a sweep: take another --report")
        (folder / RUNS_FOLDER).mkdir(parents=True, exist_ok=True)
        write_atomic(file, msgspec.json.format(msgspec.json.encode(definition)))
    except OSError as error:
        raise BadInput(f"the folder {folder} cannot be written: {error.strerror}; choose one with --report") from None


def read_definition(folder: Path) -> Definition:
    """Return the sweep of a folder; raises BadInput if there is none."""
    file = folder / DEFINITION_FILE
    try:
        return msgspec.json.decode(file.read_bytes(), type=Definition)
    except OSError as error:
        raise BadInput(f"{folder} is not a folder of a sweep: {file}: {error.strerror}") from None
    except DECODE_ERRORS as error:
        raise BadInput(f"{file} is damaged: {error}") from None


def _difference(known: Definition, new: Definition) -> str:
    """Describe the differences of a sweep's definition from the known one."""
    for name in ("fleet", "options", "axes"):
        if getattr(known, name) != getattr(new, name):
            return f"its {name} differ ({_shown(getattr(known, name))}; now {_shown(getattr(new, name))})"
    return "the fleet file, or a file that it names, has changed since"


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(f"{each.key}={','.join(each.values)}" if hasattr(each, "key") else str(each) for each in value)
    return str(value)


def run_folder(folder: Path, run: Run) -> Path:
    """Return the folder of a run."""
    return folder / RUNS_FOLDER / run.folder_name()


def pending_runs(folder: Path, definition: Definition, again: bool = False) -> list[Run]:
    """Return the runs that have not ended by themselves yet; with ``again`` also those without a report."""

    def is_pending(run: Run) -> bool:
        result = read_result(run_folder(folder, run))
        return result is None or (again and not (run_folder(folder, run) / REPORT_FILE).exists())

    return [each for each in definition.runs if is_pending(each)]


class Sweep:
    """Runs at most ``jobs`` runs at once; a first interrupt stops them in an orderly way, a second one kills them."""

    def __init__(self, folder: Path, definition: Definition, jobs: int, finished: Finished) -> None:
        self._folder, self._definition, self._jobs, self._finished = folder, definition, jobs, finished
        self._running: set[asyncio.subprocess.Process] = set()
        self.interrupted = False

    async def run(self, runs: Sequence[Run]) -> None:
        """Run these in order."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self._interrupt)
        waiting = iter(runs)
        ports = _free_ports(self._jobs)
        await asyncio.gather(*(self._work(waiting, port) for port in ports))

    async def _work(self, waiting: Iterator[Run], port: int) -> None:
        for run in waiting:
            if self.interrupted:
                return
            await self._run_one(run, port)

    async def _run_one(self, run: Run, port: int) -> None:
        folder = run_folder(self._folder, run)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / RESULT_FILE).unlink(missing_ok=True)
        command = [sys.executable, "-P", "-m", "deploy", "up", *self._definition.arguments(run)]
        command += ["--report", str(folder), "--port", str(port), "--domain", f"sweep-{port}"]
        command += ["--no-view", "--no-picture", "--no-saved", "--json"]
        began = time.monotonic()
        with open(folder / LOG_FILE, "wb") as log:
            process = await asyncio.create_subprocess_exec(
                *command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,
                env={**os.environ, SWEEP: str(os.getpid())},
            )
        self._running.add(process)
        if self.interrupted:  # while the process was being started
            _signal(process, signal.SIGINT)
        try:
            status = await process.wait()
        finally:
            self._running.discard(process)
        if self.interrupted or status == INTERRUPTED:
            return  # it was interrupted
        error = "" if (folder / REPORT_FILE).exists() else _last_line(folder / LOG_FILE, status)
        result = Result(status=status, seconds=round(time.monotonic() - began, 3), error=error)
        write_atomic(folder / RESULT_FILE, msgspec.json.encode(result), durable=True)
        self._finished(run, result)

    def _interrupt(self) -> None:
        number = signal.SIGKILL if self.interrupted else signal.SIGINT
        self.interrupted = True
        for process in self._running:
            _signal(process, number)
        asyncio.get_running_loop().call_later(_STOP_S, self._kill)

    def _kill(self) -> None:
        for process in self._running:
            _signal(process, signal.SIGKILL)


def _signal(process: asyncio.subprocess.Process, number: int) -> None:
    """Send a signal to a process, which may just have ended."""
    with suppress(ProcessLookupError):
        process.send_signal(number)


def _free_ports(count: int) -> list[int]:
    """Return ports that no running fleet of this user has; concurrent sweeps get different ones."""
    taken = {each.port for each in running_fleets()}
    begin = FIRST_PORT + os.getpid() * 64 % (LAST_PORT - FIRST_PORT - 1024)
    return [each for each in range(begin, begin + 1024 + count) if each not in taken][:count]


def _last_line(log: Path, status: int) -> str:
    """Return the last output line of a run without a report."""
    lines = [each for each in log.read_text(errors="replace").splitlines() if each.strip()]
    return lines[-1].removeprefix("elea: ") if lines else f"ended with status {status} and wrote nothing"
