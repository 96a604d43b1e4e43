"""A fleet in the background: start its supervisor away from the terminal and wait until all is ready."""

from __future__ import annotations

import subprocess
import sys
import time

import msgspec

from deploy.progress import screen
from deploy.run_folder import make_folder, read_state
from services.runtime.process import ROOT

LOG = "supervisor.log"
_TURN_S = 0.1


def up_detached(fleet: str, report: str, as_json: bool, argv: list[str] | None = None) -> int:
    """Run this command line again without ``--detach``; the exit status, once all is ready or the run is over."""
    arguments = [each for each in (argv if argv is not None else sys.argv[1:]) if each not in ("--detach", "--json")]
    folder = make_folder(fleet, report)
    command = [sys.executable, "-P", "-m", "deploy", *arguments, "--report", str(folder)]
    with (folder / LOG).open("wb") as log, screen() as shown:
        supervisor = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        while supervisor.poll() is None:
            state = read_state(folder)
            processes = state.processes if state else ()
            waiting = [each.name for each in processes if each.state != "ready"]
            if processes and not waiting:
                break
            shown.show(f"waiting for {', '.join(waiting) or 'the supervisor'}")
            time.sleep(_TURN_S)
    if supervisor.returncode is not None:
        sys.stderr.write((folder / LOG).read_text(errors="replace"))
        return supervisor.returncode
    if as_json:
        entry = {"fleet": fleet, "pid": supervisor.pid, "folder": str(folder), "root": str(ROOT)}
        sys.stdout.write(msgspec.json.encode(entry).decode() + "\n")
    else:
        sys.stdout.write(f"{fleet} runs (supervisor {supervisor.pid}), results go to {folder}; end it: ./elea down\n")
    return 0
