"""``elea interface``: the types of messages and requests."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

TABLE = {
    "list": Verb("interface.listing", "List the types of messages, and the requests."),
    "show": Verb("interface.show", "Show the fields of a type, or what a request asks and replies."),
}


@click.command("interface", cls=Verbs, table=TABLE)
def command() -> None:
    """List the types of messages and requests and show one. It needs no network."""
