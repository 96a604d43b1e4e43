"""``elea service call``: ask, and show the reply."""

from __future__ import annotations

import click

from deploy.commands.completion import SERVICE, TYPE_OR_VALUES
from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("call", context_settings={"ignore_unknown_options": True})
@click.argument("service", type=SERVICE)
@click.argument("values", nargs=-1, metavar="[TYPE] [VALUES]...", type=TYPE_OR_VALUES)
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), default=5.0, show_default=True, metavar="S", help="Deadline."
)
@click.option("--flow-style", is_flag=True, help="The reply on one line.")
@place_options
@json_option
def command(
    service: str, values: tuple[str, ...], timeout: float, flow_style: bool, place: Place, as_json: bool
) -> None:
    """Ask SERVICE. VALUES are YAML or JSON, as in '{name: tb3_0}', or the fields in their order.

    Fields left out have their defaults; TYPE is that of what is asked, and may be left out. The status is 1 when it is
    refused, with the reason, and when nobody answers in time.
    """
    from deploy.live.ends import absolute
    from deploy.live.output import say, say_json
    from deploy.live.servers import ask
    from deploy.live.text import block, flow
    from deploy.live.visit import visit

    name = absolute(service)
    with visit(place.router, place.domain) as transport:
        reply = ask(transport, name, values, timeout)
    if as_json:
        say_json(reply)
    else:
        say(flow(reply) + "\n" if flow_style else block(reply))
