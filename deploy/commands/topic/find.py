"""``elea topic find``: the topics of a type."""

from __future__ import annotations

import click

from deploy.commands.completion import TYPE
from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("find")
@click.argument("type_name", metavar="TYPE", type=TYPE)
@click.option("-c", "--count-topics", is_flag=True, help="Show how many there are.")
@place_options
@json_option
def command(type_name: str, count_topics: bool, place: Place, as_json: bool) -> None:
    """List the topics that carry TYPE, as geometry_msgs/Twist. The status is 1 when there are none at present."""
    from deploy.live.ends import topics
    from deploy.live.known import record_of, ros_type
    from deploy.live.output import note, say, say_json
    from deploy.live.visit import visit
    from services.runtime.graph import snapshot

    with visit(place.router, place.domain) as transport:
        found = topics(snapshot(transport))
    wanted = ros_type(type_name)
    names = [each.name for each in found.values() if wanted in each.types]
    if not names:
        record_of(wanted)
        note(f"no topic carries {wanted} now")
    if as_json:
        say_json(names)
    else:
        say(f"{len(names)}\n" if count_topics else "".join(f"{each}\n" for each in names))
    raise SystemExit(0 if names else 1)
