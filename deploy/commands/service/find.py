"""``elea service find``: the requests of a type."""

from __future__ import annotations

import click

from deploy.commands.completion import TYPE
from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("find")
@click.argument("type_name", metavar="TYPE", type=TYPE)
@click.option("-c", "--count-services", is_flag=True, help="Show how many there are.")
@place_options
@json_option
def command(type_name: str, count_services: bool, place: Place, as_json: bool) -> None:
    """List the requests that ask or reply TYPE, as elea_msgs/Name. The status is 1 when there are none at present."""
    from deploy.live.known import record_of, ros_type
    from deploy.live.output import note, say, say_json
    from deploy.live.servers import servers
    from deploy.live.visit import visit

    with visit(place.router, place.domain) as transport:
        found = servers(transport)
    wanted = ros_type(type_name)
    names = [each.name for each in found.values() if wanted in (each.asks, each.replies)]
    if not names:
        record_of(wanted)
        note(f"no request has {wanted} now")
    if as_json:
        say_json(names)
    else:
        say(f"{len(names)}\n" if count_services else "".join(f"{each}\n" for each in names))
    raise SystemExit(0 if names else 1)
