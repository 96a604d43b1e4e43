"""``elea topic type``: the type of a topic."""

from __future__ import annotations

import click

from deploy.commands.options import Place, json_option, place_options
from deploy.commands.topic.shared import topic_argument


@click.command("type")
@topic_argument
@place_options
@json_option
def command(topic: str, place: Place, as_json: bool) -> None:
    """Tell the type of TOPIC, or all of them when its ends do not agree."""
    from deploy.commands.network import visit
    from deploy.live.ends import absent, absolute, topics
    from deploy.live.output import say, say_json
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
