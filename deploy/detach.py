"""Runs a fleet in the background: starts its supervisor detached from the terminal and waits until all is ready."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec

from deploy.progress import open_display
from deploy.restart_policy import describe_exit
from deploy.run_folder import SUPERVISOR_LOG, check_free_space, make_run_folder, read_state
from services.runtime.errors import EleaError
from services.runtime.process import ROOT

_POLL_PERIOD_S = 0.02
_FREE_SPACE_POLLS = 100
"""Polls between two checks that the fleet's state can be written."""
_SETTLED_POLLS = 25
"""Polls for which all must be ready or have ended: the end of a process that ends the run stops the others."""
_STOP_TIMEOUT_S = 60.0


def _open_private(path: str, flags: int) -> int:
    """Open a file only this user can read: the log holds the address of the panel's page, including its token."""
    return os.open(path, flags, 0o600)


def start_detached(fleet: str, report: str, as_json: bool, runs: str = "", argv: list[str] | None = None) -> int:
    """Run this command line again without ``--detach``; return the exit status once all is ready or the run is over."""
    arguments = [each for each in (argv if argv is not None else sys.argv[1:]) if each not in ("--detach", "--json")]
    folder = make_run_folder(fleet, report, runs)
    command = [sys.executable, "-P", "-m", "deploy", *arguments, "--report", str(folder)]
    log = folder / SUPERVISOR_LOG
    log.unlink(missing_ok=True)
    with open(log, "xb", opener=_open_private) as out, open_display() as shown:
        supervisor = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
        )
        settled = 0
        for turn in itertools.count(1):
            if supervisor.poll() is not None:
                break
            state = read_state(folder)
            processes = state.processes if state else ()
            waiting = [each.name for each in processes if each.state not in ("ready", "finished", "failed")]
            settled = settled + 1 if processes and not waiting else 0
            if settled and (settled > _SETTLED_POLLS or all(each.state == "ready" for each in processes)):
                break
            if turn % _FREE_SPACE_POLLS == 0:
                _check_free_space(folder, supervisor)
            shown.set_status(f"waiting for {', '.join(waiting) or 'the supervisor'}")
            time.sleep(_POLL_PERIOD_S)
    if supervisor.returncode is not None:
        output = log.read_text(errors="replace")
        sys.stderr.write(output or f"elea: {_describe_silent_exit(supervisor.returncode, folder)}\n")
        return supervisor.returncode
    if as_json:
        entry = {"fleet": fleet, "pid": supervisor.pid, "folder": str(folder), "root": str(ROOT)}
        sys.stdout.write(msgspec.json.encode(entry).decode() + "\n")
    else:
        sys.stdout.write(
            f"{fleet} is running (supervisor {supervisor.pid}), results in {folder}; stop it with ./elea down\n"
        )
    return 0


def _check_free_space(folder: Path, supervisor: subprocess.Popen[bytes]) -> None:
    """Stop the supervisor and raise EleaError if the disk is full: its fleet's state would stay unknown."""
    try:
        check_free_space(folder)
    except OSError as error:
        supervisor.send_signal(signal.SIGINT)
        try:
            supervisor.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            supervisor.kill()
        raise EleaError(
            f"the folder {folder} cannot be written while the fleet starts: {error.strerror}; the fleet was stopped"
        ) from None


def _describe_silent_exit(status: int, folder: Path) -> str:
    """Return the error text for a supervisor that ended without any output."""
    how = f"the supervisor {describe_exit(status).replace('exit', 'ended with exit')} and has written nothing"
    try:
        check_free_space(folder)
    except OSError as error:
        return f"{how}: {folder} cannot be written: {error.strerror}"
    return f"{how} to {folder / SUPERVISOR_LOG}"
