"""``elea node list``: the nodes of the network."""

from __future__ import annotations

import click

from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("list")
@click.option("-a", "--all", "every", is_flag=True, help="Also those whose name begins with an underscore: tools.")
@click.option("-c", "--count-nodes", is_flag=True, help="Show how many there are.")
@place_options
@json_option
def command(every: bool, count_nodes: bool, place: Place, as_json: bool) -> None:
    """List the nodes that live now, and which kind of service each is."""
    from deploy.live.ends import is_hidden
    from deploy.live.output import say, say_json
    from deploy.live.visit import visit
    from services.runtime.graph import snapshot

    with visit(place.router, place.domain) as transport:
        found = [each for each in snapshot(transport) if each.kind == "node" and (every or not is_hidden(each.node))]
    if as_json:
        say_json([{"node": each.node, "kind": each.name, "session": each.session} for each in found])
    elif count_nodes:
        say(f"{len(found)}\n")
    else:
        say("".join(f"{each.node}\n" for each in found))
