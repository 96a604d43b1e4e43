"""``elea graph``: the nodes and topics of the network."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from deploy.commands.options import json_option, port_option

if TYPE_CHECKING:
    from services.runtime.graph import Entity


@click.command("graph")
@click.option("--connect", metavar="ENDPOINT", default="", help="Router to ask; the running fleet's by default.")
@click.option("--domain", default="", help="Domain of the fleet.")
@port_option
@json_option
def command(connect: str, domain: str, port: int | None, as_json: bool) -> None:
    """List every node with what it publishes, subscribes and serves, asked of the network now."""
    from deploy.commands.network import place, visit
    from services.runtime.graph import snapshot

    with visit(*place(connect, domain, port)) as transport:
        entities = snapshot(transport)
    if as_json:
        sys.stdout.write(json.dumps([asdict(each) for each in entities], indent=2) + "\n")
    else:
        sys.stdout.write(_drawn(entities))


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
