"""``elea service type``: what a request asks and replies."""

from __future__ import annotations

import click

from deploy.commands.completion import SERVICE
from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("type")
@click.argument("service", type=SERVICE)
@place_options
@json_option
def command(service: str, place: Place, as_json: bool) -> None:
    """Tell the types of what SERVICE asks and replies."""
    from deploy.live.ends import absolute
    from deploy.live.output import say, say_json
    from deploy.live.servers import find_server
    from deploy.live.visit import visit

    name = absolute(service)
    with visit(place.router, place.domain) as transport:
        found = find_server(transport, name)
    if as_json:
        say_json(found.told())
    else:
        say(f"{found.types}\n")
