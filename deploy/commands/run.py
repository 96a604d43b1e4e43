"""``elea run``: one service, or a Python file of the user's own, in this terminal."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from deploy.commands.completion import KIND
from services.runtime.errors import BadInput, unknown
from services.runtime.process import ROOT


@click.command("run", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@click.argument("target", type=KIND)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(target: str, arguments: tuple[str, ...]) -> None:
    """Run TARGET, a service by its name or a .py file of your own, with the rest of the line as its arguments.

    `./elea run waypoint --help` shows the options that all services have.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    if target.endswith(".py"):
        file = Path(target).resolve()
        if not file.is_file():
            raise BadInput(f"there is no file {target}")
        environment["PYTHONPATH"] = f"{ROOT}{os.pathsep}{file.parent}"
        place = [str(file)]
    else:
        from deploy.catalogue import kinds

        if target not in kinds():
            raise unknown("service", target, kinds())
        place = ["-m", f"services.{target}"]
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, "-P", *place, *arguments], environment)
