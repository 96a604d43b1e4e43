"""Options that several verbs share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

import click

from deploy.network_address import resolve_address

F = TypeVar("F", bound=Callable[..., Any])

json_option: Callable[[F], F] = click.option("--json", "as_json", is_flag=True, help="Print JSON.")

port_option: Callable[[F], F] = click.option(
    "--port", type=click.IntRange(1, 65535), help="Port of the fleet's router, if several fleets are running."
)


def network_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add options for the network; the verb gets a ``place``, by default that of the running fleet."""

    @click.option("--connect", metavar="ENDPOINT", default="", help="Router to join; the running fleet's by default.")
    @click.option("--domain", default="", help="Domain of the fleet.")
    @port_option
    @functools.wraps(verb)
    def placed(connect: str, domain: str, port: int | None, **values: Any) -> Any:
        return verb(place=resolve_address(connect, domain, port), **values)

    return placed
