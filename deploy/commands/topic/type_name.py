"""``elea topic type``: the type of a topic."""

from __future__ import annotations

import click

from deploy.commands.options import json_option, place_options
from deploy.commands.topic.shared import topic_argument
from deploy.place import Place


@click.command("type")
@topic_argument
@place_options
@json_option
def command(topic: str, place: Place, as_json: bool) -> None:
    """Tell the type of TOPIC, or all of them when its ends do not agree."""
    from deploy.live.ends import absent, absolute, topics
    from deploy.live.output import say, say_json
    from deploy.live.visit import visit
    from services.runtime.graph import snapshot

    name = absolute(topic)
    with visit(place.router, place.domain) as transport:
        found = topics(snapshot(transport))
    if name not in found:
        raise absent("topic", name, found, "./elea topic list tells them all")
    types = found[name].types
    if as_json:
        say_json({"topic": name, "types": types})
    else:
        say("".join(f"{each}\n" for each in types))
