"""``elea ps``: the processes of the running fleets."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from deploy.claim import Running, running
from deploy.commands.options import json_option, port_option
from deploy.live.output import printable
from deploy.place import chosen


@click.command("ps")
@port_option
@json_option
def command(port: int | None, as_json: bool) -> None:
    """List the processes of the running fleets, or of that on --port: state, restarts, memory, share of a core since
    the start.
    """
    fleets = [_fleet(each) for each in (running() if port is None else (chosen(port),))]
    if as_json:
        sys.stdout.write(json.dumps(fleets, indent=2) + "\n")
    elif not fleets:
        sys.stdout.write("no fleet runs\n")
    else:
        for fleet in fleets:
            _show(fleet)


def _fleet(entry: Running) -> dict[str, Any]:
    import msgspec

    from deploy.run_folder import read_state

    state = read_state(Path(entry.folder))
    processes = [msgspec.to_builtins(each) | _usage(each.pid) for each in (state.processes if state else ())]
    return {**msgspec.to_builtins(entry), **_usage(entry.pid), "processes": processes}


def _usage(pid: int) -> dict[str, float | None]:
    """Memory [MiB] and share of a core [%] of a process."""
    import time

    import psutil

    if not pid:
        return {"memory_mib": None, "cpu_percent": None}
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            times, age = process.cpu_times(), time.time() - process.create_time()
            memory = process.memory_info().rss / 2**20
    except psutil.Error:
        return {"memory_mib": None, "cpu_percent": None}
    return {"memory_mib": round(memory, 1), "cpu_percent": round(100 * (times.user + times.system) / max(age, 0.1), 1)}


def _show(fleet: dict[str, Any]) -> None:
    sys.stdout.write(
        f"{fleet['fleet']} ({fleet['mode']}) on port {fleet['port']}"
        f"{', domain ' + fleet['domain'] if fleet['domain'] else ''}, supervisor {fleet['pid']}, {fleet['folder']}\n"
    )
    rows = [("NAME", "STATE", "PID", "RESTARTS", "MIB", "CPU %", "")]
    for each in fleet["processes"]:
        pid, memory, cpu = each["pid"] or "", each["memory_mib"], each["cpu_percent"]
        shown = ("" if memory is None else memory, "" if cpu is None else cpu)
        rows.append((each["name"], each["state"], str(pid), str(each["restarts"]), *map(str, shown), each["reason"]))
    widths = [max(len(row[column]) for row in rows) for column in range(6)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        sys.stdout.write(printable("  ".join((*cells, row[6])).rstrip()) + "\n")
