"""``elea down``: end a running fleet."""

from __future__ import annotations

import os
import select
import signal
import sys

import click

from deploy.claim import Running, running
from deploy.commands.options import port_option
from deploy.place import chosen

LONGEST_S = 60.0
"""Wall time that a fleet has to stop by SIGINT, with its report, before its supervisor is killed. The supervisor needs
40 s at most, however its processes behave: four stages (controllers, simulation, parameters, router), each with 5 s
after SIGINT, 3 s after SIGTERM and 2 s after SIGKILL."""


@click.command("down")
@port_option
@click.option("--all", "every", is_flag=True, help="End every fleet of this user.")
def command(port: int | None, every: bool) -> None:
    """End a running fleet in the reverse order of its start; its report is written.

    That takes a second or two; 60 s at most, also when processes hang. A supervisor that takes longer is killed, and
    its processes with it: then the report is missing and the status is 1.
    """
    killed = False
    handles = [(each, handle) for each in (running() if every else (chosen(port),)) if (handle := _handle(each))]
    for _, handle in handles:
        signal.pidfd_send_signal(handle, signal.SIGINT)
    for fleet, handle in handles:
        sys.stderr.write(f"stopping {fleet.fleet} (supervisor {fleet.pid})\n")
        if not _ends_within(handle, LONGEST_S):
            sys.stderr.write(f"{fleet.fleet} does not stop: killing its supervisor\n")
            signal.pidfd_send_signal(handle, signal.SIGKILL)
            _ends_within(handle, 5.0)
            killed = True
        sys.stdout.write(f"{fleet.fleet} has ended; results in {fleet.folder}\n")
    if killed:
        raise SystemExit(1)


def _handle(fleet: Running) -> int | None:
    """A descriptor of the supervisor; None when it has ended meanwhile. It stays this process's, whoever gets the
    number later, since the fleet still runs after it was opened.
    """
    try:
        handle = os.pidfd_open(fleet.pid)
    except ProcessLookupError:
        return None
    return handle if fleet in running() else None


def _ends_within(handle: int, seconds: float) -> bool:
    """Wait for the end of a process."""
    return bool(select.select([handle], [], [], seconds)[0])
