"""``elea service list``: the requests that somebody serves."""

from __future__ import annotations

import click

from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("list")
@click.option("-t", "--show-types", is_flag=True, help="Show what each asks and replies.")
@click.option("-v", "--verbose", is_flag=True, help="Show types, nodes and what each does.")
@click.option("-c", "--count-services", is_flag=True, help="Show how many there are.")
@place_options
@json_option
def command(show_types: bool, verbose: bool, count_services: bool, place: Place, as_json: bool) -> None:
    """List the requests that somebody serves now."""
    from deploy.live.output import say, say_json
    from deploy.live.servers import servers
    from deploy.live.visit import visit

    with visit(place.router, place.domain) as transport:
        found = servers(transport)
    if as_json:
        say_json([each.told() for each in found.values()])
    elif count_services:
        say(f"{len(found)}\n")
    else:
        for each in found.values():
            say(each.name + (f" [{each.types}]" if show_types or verbose else "") + "\n")
            if verbose:
                say(f"  {', '.join(each.nodes)}{f': {each.about}' if each.about else ''}\n")
