"""``elea logs``: what the processes of a fleet have written."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import click

from deploy.claim import running
from deploy.commands.completion import PROCESS
from deploy.commands.options import json_option, port_option
from deploy.live.output import printable
from deploy.place import chosen
from deploy.run_folder import latest_folder, read_state
from deploy.supervisor.log_file import log_name
from services.runtime.errors import BadInput, unknown

_TURN_S = 0.2


@click.command("logs")
@click.argument("name", default="", type=PROCESS)
@click.option("-f", "--follow", is_flag=True, help="Go on as more is written, until Ctrl-C.")
@port_option
@json_option
def command(name: str, follow: bool, port: int | None, as_json: bool) -> None:
    """Show the log of process NAME, or of all; of the running fleet, or of the latest run, wherever its results went.

    With --json, each line is an object with the process and the text.
    """
    folder = Path(chosen(port).folder) if running() or port is not None else latest_folder()
    if folder is None:
        raise BadInput("there is no run yet: start one with ./elea up")
    files = {path.name.removesuffix(".log"): path for path in sorted((folder / "logs").glob("*.log"))}
    wanted = log_name(name.removeprefix("/")).removesuffix(".log") if name else ""
    if wanted and wanted not in files:
        state = read_state(folder)
        known = {each.name for each in (state.processes if state else ())}
        if name.removeprefix("/") not in known:
            raise unknown("process", name, sorted(known | {each.replace(".", "/") for each in files}))
        sys.stderr.write(f"{name} has written nothing yet\n")
        files[wanted] = folder / "logs" / log_name(name.removeprefix("/"))
    tails = [Tail(each.replace(".", "/"), path) for each, path in files.items() if wanted in ("", each)]
    try:
        while True:
            for tail in tails:
                for line in tail.lines():
                    _print(tail.name, line, as_json, alone=bool(name))
            sys.stdout.flush()
            if not follow:
                return
            time.sleep(_TURN_S)
    except KeyboardInterrupt:
        return


class Tail:
    """A log that is read to its end again and again, also when it is begun anew."""

    def __init__(self, name: str, path: Path) -> None:
        self.name = name
        self._path, self._offset, self._rest = path, 0, b""

    def lines(self) -> Iterator[str]:
        """What has been added, whole lines only."""
        try:
            with self._path.open("rb") as file:
                if file.seek(0, 2) < self._offset:
                    self._offset, self._rest = 0, b""
                file.seek(self._offset)
                added = file.read()
                self._offset = file.tell()
        except FileNotFoundError:
            return
        *whole, self._rest = (self._rest + added).split(b"\n")
        for line in whole:
            yield line.decode(errors="replace")


def _print(name: str, line: str, as_json: bool, alone: bool) -> None:
    if as_json:
        import json

        sys.stdout.write(json.dumps({"process": name, "text": line}) + "\n")
    else:
        sys.stdout.write(printable(f"{line}\n" if alone else f"{name} | {line}\n"))
