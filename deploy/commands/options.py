"""Options that several verbs share, and the fleet that they choose."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import click

from deploy.claim import Running, running
from deploy.fleet import PORT
from services.runtime.errors import BadInput

F = TypeVar("F", bound=Callable[..., Any])

json_option: Callable[[F], F] = click.option("--json", "as_json", is_flag=True, help="Print JSON.")

port_option: Callable[[F], F] = click.option(
    "--port", type=click.IntRange(1, 65535), help="Port of the fleet's router, where several fleets run."
)


class Place(NamedTuple):
    """A network to join: the endpoint of a router, and the domain of the fleet."""

    router: str
    domain: str


def place_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """The options that say which network is meant; the verb gets a ``place``, of the running fleet by default."""

    @click.option("--connect", metavar="ENDPOINT", default="", help="Router to join; the running fleet's by default.")
    @click.option("--domain", default="", help="Domain of the fleet.")
    @port_option
    @functools.wraps(verb)
    def placed(connect: str, domain: str, port: int | None, **values: Any) -> Any:
        return verb(place=place_of(connect, domain, port), **values)

    return placed


def place_of(connect: str = "", domain: str = "", port: int | None = None) -> Place:
    """The network that the options name; raises BadInput where several fleets run and none is chosen."""
    if not connect and running():
        fleet = chosen(port)
        return Place(f"tcp/127.0.0.1:{fleet.port}", domain or fleet.domain)
    return Place(connect or f"tcp/127.0.0.1:{port or PORT}", domain)


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
