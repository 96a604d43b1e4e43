"""``elea down``, ``ps``, ``logs`` and ``restart``: the running fleets."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from deploy.commands.completion import PROCESS, RUNNING_FLEET
from deploy.commands.options import filter_option, fits, fleet_option, json_option
from deploy.live.output import printable
from deploy.report.record import REPORT_FILE
from deploy.run_folder import SUPERVISOR_LOG, latest_run_folder, read_state
from deploy.supervisor.log_file import NOTE, last_line, log_name
from services.runtime.errors import BadInput, unknown_name
from services.runtime.fleet_instances import FleetInstance, running_fleets
from services.runtime.network_address import fleet_router, port_of_fleet, select_fleet

STOP_TIMEOUT_S = 60.0
"""Wall time for a fleet to stop on SIGINT and write its report, before its supervisor is killed. The supervisor needs
at most 40 s, however its processes behave: four stages (controllers, simulation, parameters, router), each with 5 s
after SIGINT, 3 s after SIGTERM and 2 s after SIGKILL."""


@click.command("down")
@fleet_option
@click.option("--all", "every", is_flag=True, help="Stop all fleets of this user.")
@click.argument("name", required=False, type=RUNNING_FLEET)
def down_command(port: int | None, every: bool, name: str | None) -> None:
    """Stop a running fleet, in reverse start order, and write its report.

    NAME selects it as --fleet does, if several are running.

    This takes a second or two, and 60 s at most, even if processes hang. A supervisor that takes longer is killed with
    its processes. The exit status is 1 if the report is missing.
    """
    if name is not None:
        if every:
            raise BadInput(f"--all stops every fleet: give either --all or the name {name}")
        port = port_of_fleet(name, port)
    complete = True
    handles = [
        (each, handle)
        for each in (running_fleets() if every else (select_fleet(port),))
        if (handle := _open_pidfd(each))
    ]
    for _, handle in handles:
        signal.pidfd_send_signal(handle, signal.SIGINT)
    for fleet, handle in handles:
        sys.stderr.write(f"stopping {fleet.fleet} (supervisor {fleet.pid})\n")
        if not _wait_for_exit(handle, STOP_TIMEOUT_S):
            sys.stderr.write(f"{fleet.fleet} did not stop: killing its supervisor\n")
            signal.pidfd_send_signal(handle, signal.SIGKILL)
            _wait_for_exit(handle, 5.0)
        sys.stdout.write(f"{fleet.fleet} has stopped; results in {fleet.folder}\n")
        if not (Path(fleet.folder) / REPORT_FILE).exists():
            complete = False
            why = last_line(Path(fleet.folder) / SUPERVISOR_LOG).removeprefix("elea: ")
            sys.stderr.write(f"elea: {why or f'no report in {fleet.folder}: see the terminal of its ./elea up'}\n")
    if not complete:
        raise SystemExit(1)


def _open_pidfd(fleet: FleetInstance) -> int | None:
    """Return a pidfd of the supervisor; None if it has exited. It cannot refer to a later process with the same id,
    since the fleet is still running after it was opened.
    """
    try:
        handle = os.pidfd_open(fleet.pid)
    except ProcessLookupError:
        return None
    return handle if fleet in running_fleets() else None


def _wait_for_exit(handle: int, seconds: float) -> bool:
    """Wait for a process to exit; return whether it has."""
    return bool(select.select([handle], [], [], seconds)[0])


@click.command("ps")
@filter_option
@fleet_option
@json_option
def ps_command(pattern: str, port: int | None, as_json: bool) -> None:
    """List the processes of the running fleets, with state, restarts, memory and mean processor load.

    Nodes that share a process are listed below it; the last line has the sums over the processes listed.
    """
    fleets = [_describe_fleet(each, pattern) for each in (running_fleets() if port is None else (select_fleet(port),))]
    if as_json:
        sys.stdout.write(json.dumps(fleets, indent=2) + "\n")
    elif not fleets:
        sys.stdout.write("no fleet is running\n")
    else:
        for fleet in fleets:
            _print_fleet(fleet)


def _describe_fleet(entry: FleetInstance, pattern: str = "") -> dict[str, Any]:
    import msgspec

    from deploy.run_folder import read_state

    state = read_state(Path(entry.folder))
    shown = [
        each
        for each in (state.processes if state else ())
        if any(fits(name, pattern) for name in (each.name, *each.nodes))
    ]
    processes = [msgspec.to_builtins(each) | _usage(each.pid) for each in shown]
    return {**msgspec.to_builtins(entry), **_usage(entry.pid), "processes": processes}


def _usage(pid: int) -> dict[str, float | None]:
    """Return memory [MiB] and processor load [%] of a process."""
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


def _print_fleet(fleet: dict[str, Any]) -> None:
    sys.stdout.write(
        f"{fleet['fleet']} ({fleet['mode']}) on port {fleet['port']}"
        f"{', domain ' + fleet['domain'] if fleet['domain'] else ''}, supervisor {fleet['pid']}, {fleet['folder']}\n"
    )
    rows = [("NAME", "STATE", "PID", "RESTARTS", "MIB", "CPU %", "")]
    for each in fleet["processes"]:
        pid, memory, cpu = each["pid"] or "", each["memory_mib"], each["cpu_percent"]
        shown = ("" if memory is None else memory, "" if cpu is None else cpu)
        rows.append((each["name"], each["state"], str(pid), str(each["restarts"]), *map(str, shown), each["reason"]))
        rows += [(f"  {node[1:]}", each["state"], "", "", "", "", f"in {each['name']}") for node in each["nodes"]]
    rows.append(_sum_row(fleet["processes"]))
    widths = [max(len(row[column]) for row in rows) for column in range(6)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        sys.stdout.write(printable("  ".join((*cells, row[6])).rstrip()) + "\n")


def _sum_row(processes: list[dict[str, Any]]) -> tuple[str, str, str, str, str, str, str]:
    """Return the last row: the number of processes by state, and their total memory and load."""
    states = Counter(each["state"] for each in processes)
    memory, cpu = (sum(each[name] or 0.0 for each in processes) for name in ("memory_mib", "cpu_percent"))
    restarts = sum(each["restarts"] for each in processes)
    counts = ", ".join(f"{count} {state}" for state, count in states.most_common())
    return f"{len(processes)} processes", counts, "", str(restarts), f"{memory:.1f}", f"{cpu:.1f}", ""


_TAIL_PERIOD_S = 0.2


@click.command("logs")
@click.argument("name", default="", type=PROCESS)
@click.option("-f", "--follow", is_flag=True, help="Keep printing new lines until Ctrl-C.")
@fleet_option
@json_option
def logs_command(name: str, follow: bool, port: int | None, as_json: bool) -> None:
    """Show the log of process NAME, or all logs, of the running fleet or the latest run.

    For a node that shares its process, only its own lines and the supervisor's are shown.

    With --json, each line is an object with the process and the text.
    """
    folder = Path(select_fleet(port).folder) if running_fleets() or port is not None else latest_run_folder()
    if folder is None:
        raise BadInput("there is no run yet: start one with ./elea up")
    files = {path.name.removesuffix(".log"): path for path in sorted((folder / "logs").glob("*.log"))}
    stem = log_name(name.removeprefix("/")).removesuffix(".log") if name else ""
    state = read_state(folder)
    processes = state.processes if state else ()
    node = f"/{name.removeprefix('/')}"
    shared = next((each.name for each in processes if node in each.nodes), "") if name else ""
    if shared:
        stem = log_name(shared).removesuffix(".log")
    if stem and stem not in files:
        known = {each.name for each in processes} | {member[1:] for each in processes for member in each.nodes}
        if name.removeprefix("/") not in known:
            raise unknown_name("process", name, sorted(known | {each.replace(".", "/") for each in files}))
        sys.stderr.write(f"{name} has written nothing yet\n")
        files[stem] = folder / "logs" / f"{stem}.log"
    tails = [LogTail(each.replace(".", "/"), path) for each, path in files.items() if stem in ("", each)]
    try:
        while True:
            for tail in tails:
                for line in tail.lines() if not shared else tail.lines_of(node):
                    _print_log_line(tail.name, line, as_json, alone=bool(name))
            sys.stdout.flush()
            if not follow:
                return
            time.sleep(_TAIL_PERIOD_S)
    except KeyboardInterrupt:
        return


_LINE = re.compile(r"\[-?\d+\.\d+\] [A-Z]+ (/\S+): ")
"""The beginning of a node's line in a log, as written by ``services.runtime.log``."""


class LogTail:
    """Follows a log file, even if it is truncated."""

    def __init__(self, name: str, path: Path) -> None:
        self.name = name
        self._owner = ""
        self._path, self._offset, self._rest = path, 0, b""

    def lines(self) -> Iterator[str]:
        """Yield the complete lines added since the last call."""
        try:
            with self._path.open("rb") as file:
                if file.seek(0, 2) < self._offset:
                    self._offset, self._rest = 0, b""
                file.seek(self._offset)
                added = file.read()
                self._offset = file.tell()
        except FileNotFoundError:
            return
        *complete, self._rest = (self._rest + added).split(b"\n")
        for line in complete:
            yield line.decode(errors="replace")

    def lines_of(self, node: str) -> Iterator[str]:
        """Yield the lines of one node, each with its continuation lines, and the supervisor's."""
        for line in self.lines():
            if found := _LINE.match(line):
                self._owner = found[1]
            elif line.startswith(NOTE):
                self._owner = ""
            if self._owner in ("", node):
                yield line


def _print_log_line(name: str, line: str, as_json: bool, alone: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps({"process": name, "text": line}) + "\n")
    else:
        sys.stdout.write(printable(f"{line}\n" if alone else f"{name} | {line}\n"))


@click.command("restart")
@click.argument("name", type=PROCESS)
@fleet_option
@json_option
def restart_command(name: str, port: int | None, as_json: bool) -> None:
    """Restart process NAME, as listed by `./elea ps`, or that of node NAME: all nodes that share it restart."""
    from messages.names import key
    from messages.requests import SUPERVISOR_RESTART, Name
    from services.runtime.light_node import open_transport
    from services.runtime.requests import call

    fleet = select_fleet(port)
    with open_transport(fleet_router(fleet), fleet.domain) as transport:
        done = call(transport, SUPERVISOR_RESTART, key(SUPERVISOR_RESTART.name), Name(name=name))
    sys.stdout.write(json.dumps({"text": done.text}) + "\n" if as_json else f"{done.text}\n")
