"""``elea tf``: the tree of frames on live data."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

TABLE = {
    "tree": Verb("tf.tree", "Show all frames with their publishers, rates and ages."),
    "echo": Verb("tf.echo", "Show where one frame lies in another."),
}


@click.command("tf", cls=Verbs, table=TABLE)
def command() -> None:
    """Show the tree of frames, and where one lies in another, asked of the network now: there is no daemon."""
