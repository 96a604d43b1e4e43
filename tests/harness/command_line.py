"""The command line as a user runs it, with a state folder and port of its own."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path
from typing import NamedTuple

from services.runtime.process import ROOT
from tests.harness.fork_server import ForkedVerb
from tests.harness.ports import free_port

WITHIN_S = 300.0
"""Wall time limit of a command; on a slow, busy machine a run of some seconds takes a third of it."""


class CommandResult(NamedTuple):
    """A command's exit status, standard output and standard error."""

    status: int
    out: str
    err: str


class CommandLine:
    """Runs ``python -m deploy`` in ``folder``, with its state there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = free_port()
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder / "state")}

    def run(self, *arguments: str, within: float = WITHIN_S) -> CommandResult:
        """Run a command to its end; after ``within`` [s], kill it and all that it started, and fail."""
        return self.finish(self.start(*arguments), within)

    def finish(self, process: subprocess.Popen[str], within: float = WITHIN_S) -> CommandResult:
        """Wait for a started command; after ``within`` [s], kill it and all that it started, and fail."""
        try:
            out, err = process.communicate(timeout=within)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            _, err = process.communicate()
            raise AssertionError(f"{process.args!r} did not end within {within} s:\n{err}") from None
        return CommandResult(process.returncode, out, err)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """Start a command without waiting for its end."""
        return ForkedVerb(arguments, self.folder, self.environment)

    def run_fleet(self, fleet: str | Path, results: Path, *options: str, picture: bool = False) -> CommandResult:
        """Run a fleet to its end, without a viewer."""
        return self.finish(self.start_fleet(fleet, results, *options, picture=picture))

    def start_fleet(
        self, fleet: str | Path, results: Path, *options: str, picture: bool = False
    ) -> subprocess.Popen[str]:
        """Start a fleet without waiting for its end."""
        at = ("--port", str(self.port), "--report", str(results), "--no-view")
        return self.start("up", str(fleet), *at, *(() if picture else ("--no-picture",)), *options)
