"""``elea topic``: everything about topics, on live data."""

from __future__ import annotations

import click

from deploy.commands.table import Verb, Verbs

TABLE = {
    "list": Verb("topic.listing", "List the topics of the network."),
    "echo": Verb("topic.echo", "Show the messages of a topic."),
    "hz": Verb("topic.hz", "Measure how often topics come."),
    "bw": Verb("topic.bw", "Measure how many bytes a topic takes."),
    "delay": Verb("topic.delay", "Measure how late a topic comes."),
    "info": Verb("topic.info", "Tell who publishes and who subscribes to a topic."),
    "pub": Verb("topic.publish", "Publish messages."),
    "find": Verb("topic.find", "List the topics of a type."),
    "type": Verb("topic.type_name", "Tell the type of a topic."),
}


@click.command("topic", cls=Verbs, table=TABLE)
def command() -> None:
    """List, show, measure and publish topics, asked of the network now: there is no daemon."""
