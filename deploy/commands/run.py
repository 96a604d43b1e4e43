"""``elea run``: run a service, or a Python file of the user's own, in this terminal."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from deploy.commands.completion import KIND
from deploy.commands.options import fleet_option
from services.runtime import process
from services.runtime.errors import BadInput, unknown_name
from services.runtime.network_address import port_of_fleet, resolve_address
from services.runtime.process import ROOT


@click.command("run", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@fleet_option
@click.argument("target", type=KIND)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(target: str, arguments: tuple[str, ...], port: int | None) -> None:
    """Run TARGET, the name of a service or a .py file of your own, with the remaining arguments.

    It joins the running fleet (--fleet or --port selects one of several) unless --connect is given.

    `./elea run waypoint --help` shows the options that all services have.

    A Python environment of your own finds Elea by a file elea.pth in its site-packages whose one line is the path of
    this checkout, if it has the packages of requirements.lock; `./elea python` runs this project's own.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    port, arguments = _extract_fleet(port, arguments)
    if target != "router" and not _states_network(arguments):
        arguments = (*_network_arguments(port, arguments), *arguments)
    if target.endswith(".py"):
        file = Path(target).resolve()
        if not file.is_file():
            raise BadInput(f"there is no file {target}")
        environment["PYTHONPATH"] = f"{ROOT}{os.pathsep}{file.parent}"
        place = [str(file)]
    else:
        from services.catalog import service_kinds

        if target not in service_kinds():
            raise unknown_name("service", target, service_kinds())
        place = ["-m", "services", target]
    environment[process.PROGRAM] = f"./elea run {target}"
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, "-P", *place, *arguments], environment)


def _extract_fleet(port: int | None, arguments: tuple[str, ...]) -> tuple[int | None, tuple[str, ...]]:
    """Return the port that --port or --fleet after TARGET selects, and the other arguments; raises BadInput."""
    fleet, left = "", list(arguments)
    for option in ("--port", "--fleet"):
        index = next((at for at, word in enumerate(left) if word.partition("=")[0] == option), None)
        if index is None:
            continue
        _, equals, value = left[index].partition("=")
        value = value if equals else "".join(left[index + 1 : index + 2])
        del left[index : index + (1 if equals else 2)]
        if option == "--fleet":
            fleet = value
        elif value.isdigit() and 0 < int(value) <= 65535:
            port = int(value)
        else:
            raise BadInput(f"--port {value}: give the port of a fleet's router, 1 to 65535")
    return (port_of_fleet(fleet, port) if fleet else port), tuple(left)


def _states_network(arguments: tuple[str, ...]) -> bool:
    """Whether the arguments select a network, or need none."""
    return any(each.partition("=")[0] in ("--connect", "--help", "--print-config") for each in arguments)


def _network_arguments(port: int | None, arguments: tuple[str, ...]) -> list[str]:
    """Return the arguments for joining the selected fleet; keep a given domain."""
    place = resolve_address(port=port)
    if any(each.partition("=")[0] == "--domain" for each in arguments):
        place = place._replace(domain="")
    return place.arguments


@click.command("python", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def python_command(arguments: tuple[str, ...]) -> None:
    """Run the Python of this project with ARGUMENTS, from any folder: a script, -m MODULE, or none for a prompt.

    It can import Elea, as in `from services.runtime import connect`.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))}
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, *arguments], environment)
