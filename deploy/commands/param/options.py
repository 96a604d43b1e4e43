"""Options of all verbs of ``elea param``, and the visit to the parameter service that they describe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

import click

from deploy.commands.options import json_option, port_option
from deploy.place import place_of

if TYPE_CHECKING:
    from deploy.commands.param.client import Client

F = TypeVar("F", bound=Callable[..., Any])


def network(function: F) -> F:
    """Adds ``--connect``, ``--domain``, ``--port``, ``--timeout`` and ``--json``."""
    for option in (
        json_option,
        click.option(
            "-t", "--timeout", type=click.FloatRange(0.1, 600), default=5.0, show_default=True, help="Wait so long, s."
        ),
        port_option,
        click.option("--domain", default="", help="Domain of the fleet."),
        click.option("--connect", metavar="ENDPOINT", default="", help="Router to ask; by default the fleet's."),
    ):
        function = option(function)
    return function


@contextmanager
def visiting(options: dict[str, Any]) -> Iterator[Client]:
    """The client at the place that the options say; what is left in ``options`` are the verb's own."""
    from deploy.commands.param.client import Client
    from deploy.live.visit import visit

    place = place_of(*(options.pop(name) for name in ("connect", "domain", "port")))
    timeout = options.pop("timeout")
    with visit(place.router, place.domain) as transport:
        yield Client(transport, timeout)
