"""``elea graph``: the nodes and topics of the network."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from deploy.commands.options import json_option, place_options
from deploy.place import Place

if TYPE_CHECKING:
    from services.runtime.graph import Entity


@click.command("graph")
@place_options
@json_option
def command(place: Place, as_json: bool) -> None:
    """List every node with what it publishes, subscribes and serves, asked of the network now."""
    from deploy.live.output import say, say_json
    from deploy.live.visit import visit
    from services.runtime.graph import snapshot

    with visit(place.router, place.domain) as transport:
        entities = snapshot(transport)
    if as_json:
        say_json([asdict(each) for each in entities])
    else:
        say(_drawn(entities))


def _drawn(entities: list[Entity]) -> str:
    """Each node with its ends below it, each topic with its type and quality."""
    arrows = {"pub": "->", "sub": "<-", "srv": "serves"}
    lines = []
    for node in sorted({each.node for each in entities}):
        own = [each for each in entities if each.node == node]
        kind = next((each.name for each in own if each.kind == "node"), "")
        lines.append(f"{node}  ({kind})" if kind else node)
        for each in own:
            if each.kind in arrows:
                quality = "" if each.kind == "srv" else f", {each.detail.lower()}"
                lines.append(f"  {arrows[each.kind]} {each.name}  [{each.record}{quality}]")
    return "\n".join(lines) + "\n" if lines else "nobody is there\n"
