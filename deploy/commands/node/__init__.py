"""``elea node``: the nodes of the network."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

TABLE = {
    "list": Verb("node.listing", "List the nodes of the network."),
    "info": Verb("node.info", "Tell what a node publishes, subscribes and serves, and how it is."),
    "ping": Verb("node.ping", "Measure the round trip to a node's loop."),
}


@click.command("node", cls=Verbs, table=TABLE)
def command() -> None:
    """List nodes, tell of one and ping it, asked of the network now: there is no daemon."""
