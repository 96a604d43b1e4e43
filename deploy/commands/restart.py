"""``elea restart``: restart a process of a running fleet."""

from __future__ import annotations

import json
import sys

import click

from deploy.commands.completion import PROCESS
from deploy.commands.options import json_option, port_option
from deploy.place import chosen, router_of


@click.command("restart")
@click.argument("name", type=PROCESS)
@port_option
@json_option
def command(name: str, port: int | None, as_json: bool) -> None:
    """Stop process NAME, as `./elea ps` calls it, and start it again."""
    from deploy.live.visit import visit
    from messages.names import key
    from messages.requests import SUPERVISOR_RESTART, Name
    from services.runtime.calls import call

    fleet = chosen(port)
    with visit(router_of(fleet), fleet.domain) as transport:
        done = call(transport, SUPERVISOR_RESTART, key(SUPERVISOR_RESTART.name), Name(name=name))
    sys.stdout.write(json.dumps({"text": done.text}) + "\n" if as_json else f"{done.text}\n")
