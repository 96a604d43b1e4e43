"""The command line of a component container: ``python -m services container``."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import click

from services.runtime.errors import BadInput
from services.runtime.main import describe_config, network_options, run_program, service_command
from services.runtime.service import Service

NAME = "container"
"""The name that follows ``python -m services`` in place of a service."""

ABOUT = """Run several nodes in one process, on one connection and in one thread.

Each --node is the command line of a service or of a file of your own, as after ./elea run:

    --node "waypoint --namespace /tb3_0" --node "waypoint --namespace /tb3_1"
"""

LoadService = Callable[[str], Service]
"""Returns the service with a name, or of a Python file; raises BadInput."""


def run_container_command_line(arguments: list[str], load: LoadService, program: str) -> None:
    """Run a container with the options in ``arguments`` and end the process, like ``run_command_line``."""

    def run(options: dict[str, Any]) -> None:
        from services.runtime.start import run_container

        run_container(options["members"], options["network"])

    name = _stated_name(arguments)
    run_program(name, container_command(load), arguments, program, run)


def container_command(load: LoadService) -> click.Command:
    """Return the click command of a container; its callback returns the options, checked without the network."""
    option = click.Option
    return click.Command(
        NAME,
        callback=partial(_check, load),
        help=ABOUT,
        params=[
            option(["--name"], default=NAME, help="Name of the process in messages."),
            option(["--node"], multiple=True, metavar="COMMAND", help="A service and its options; may be repeated."),
            option(["--nodes"], metavar="FILE", help="A file with the command line of a node in each line."),
            *network_options(),
        ],
    )


def _check(
    load: LoadService, name: str, node: tuple[str, ...], nodes: str | None, print_config: bool, **network: Any
) -> dict[str, Any] | None:
    members: list[tuple[Service, dict[str, Any]]] = []
    taken: dict[str, str] = {}
    for where, line in (*(("--node", each) for each in node), *(_lines(nodes) if nodes else ())):
        service, options = _member(load, where, line)
        if (identity := options["identity"].node) in taken:
            raise BadInput(
                f"{where}: a node {identity} is already declared at {taken[identity]}: give it another --name"
            )
        taken[identity] = where
        members.append((service, options))
    if not members:
        raise BadInput('a container needs nodes: --node "waypoint --namespace /tb3_0", or --nodes FILE')
    if print_config:
        nodes_shown = [describe_config(service, {**options, **network}) for service, options in members]
        click.echo(json.dumps({"name": name, **network, "nodes": nodes_shown}, indent=2))
        return None
    return {"name": name, "members": members, "network": network}


def _member(load: LoadService, where: str, line: str) -> tuple[Service, dict[str, Any]]:
    try:
        kind, *arguments = shlex.split(line) or [""]
    except ValueError as error:
        raise BadInput(f"{where}: {line[:80]!r} is not a service with its options: {error}") from None
    try:
        service = load(kind)
        if service.reason_alone:
            raise BadInput(f"{kind} cannot share a process: {service.reason_alone}")
        options = service_command(service).main(arguments, kind, standalone_mode=False)
    except click.ClickException as error:
        raise BadInput(f"{where}: {kind}: {error.format_message()}") from None
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    if not isinstance(options, dict):
        raise BadInput(f"{where}: {kind} must run: leave out the option that only describes it")
    return service, options


def _lines(file: str) -> Iterator[tuple[str, str]]:
    """Yield ``file:number`` and the text of each line that is not empty."""
    try:
        text = Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"--nodes: {file} cannot be read: {error}") from None
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            yield f"{file}:{number}", line


def _stated_name(arguments: list[str]) -> str:
    """Return the name of the process, before its options are parsed."""
    for word, value in pairwise([*arguments, NAME]):
        if word == "--name":
            return value
        if word.startswith("--name="):
            return word.removeprefix("--name=")
    return NAME
