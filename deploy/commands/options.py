"""Options that several verbs share, and the fleet that they choose."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from deploy.claim import Running, running
from services.runtime.errors import BadInput

F = TypeVar("F", bound=Callable[..., Any])

json_option: Callable[[F], F] = click.option("--json", "as_json", is_flag=True, help="Print JSON.")

port_option: Callable[[F], F] = click.option(
    "--port", type=click.IntRange(1, 65535), help="Port of the fleet's router, where several fleets run."
)


def chosen(port: int | None) -> Running:
    """The fleet that runs on ``port``, or the only one; raises BadInput."""
    fleets = running()
    if not fleets:
        raise BadInput("no fleet runs: start one with ./elea up")
    if port is None and len(fleets) == 1:
        return fleets[0]
    for each in fleets:
        if each.port == port:
            return each
    listed = ", ".join(f"{each.fleet} (--port {each.port})" for each in fleets)
    raise BadInput(
        f"{'several fleets run' if port is None else f'no fleet runs on port {port}'}: choose one of {listed}"
    )
