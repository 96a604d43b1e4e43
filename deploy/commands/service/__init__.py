"""``elea service``: requests and who answers them."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

TABLE = {
    "list": Verb("service.listing", "List the requests that somebody serves."),
    "type": Verb("service.type_name", "Tell what a request asks and replies."),
    "find": Verb("service.find", "List the requests of a type."),
    "call": Verb("service.call", "Ask, and show the reply."),
}


@click.command("service", cls=Verbs, table=TABLE)
def command() -> None:
    """List requests and call one, asked of the network now: there is no daemon."""
