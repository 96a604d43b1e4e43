"""``elea service``: list, describe and call services."""

from __future__ import annotations

import click

from deploy.commands.completion import SERVICE, TYPE, TYPE_OR_VALUES
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option, network_options
from deploy.network_address import NetworkAddress

COMMANDS = {
    "list": LazyCommand("service:list_command", "List the requests that somebody serves."),
    "type": LazyCommand("service:type_command", "Tell what a request asks and replies."),
    "find": LazyCommand("service:find_command", "List the requests of a type."),
    "call": LazyCommand("service:call_command", "Ask, and show the reply."),
}


@click.command("service", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """List requests and call one, asked of the network now: there is no daemon."""


@click.command("list")
@click.option("-t", "--show-types", is_flag=True, help="Show what each asks and replies.")
@click.option("-v", "--verbose", is_flag=True, help="Show types, nodes and what each does.")
@click.option("-c", "--count-services", is_flag=True, help="Show how many there are.")
@network_options
@json_option
def list_command(show_types: bool, verbose: bool, count_services: bool, place: NetworkAddress, as_json: bool) -> None:
    """List the requests that somebody serves now."""
    from deploy.live.connect import connect
    from deploy.live.output import write_json, write_text
    from deploy.live.services import list_services

    with connect(place.router, place.domain) as transport:
        found = list_services(transport)
    if as_json:
        write_json([each.as_dict() for each in found.values()])
    elif count_services:
        write_text(f"{len(found)}\n")
    else:
        for each in found.values():
            write_text(each.name + (f" [{each.types}]" if show_types or verbose else "") + "\n")
            if verbose:
                write_text(f"  {', '.join(each.nodes)}{f': {each.about}' if each.about else ''}\n")


@click.command("type")
@click.argument("service", type=SERVICE)
@network_options
@json_option
def type_command(service: str, place: NetworkAddress, as_json: bool) -> None:
    """Tell the types of what SERVICE asks and replies."""
    from deploy.live.connect import connect
    from deploy.live.output import write_json, write_text
    from deploy.live.services import find_service
    from deploy.live.topics import absolute_name

    name = absolute_name(service)
    with connect(place.router, place.domain) as transport:
        found = find_service(transport, name)
    if as_json:
        write_json(found.as_dict())
    else:
        write_text(f"{found.types}\n")


@click.command("find")
@click.argument("type_name", metavar="TYPE", type=TYPE)
@click.option("-c", "--count-services", is_flag=True, help="Show how many there are.")
@network_options
@json_option
def find_command(type_name: str, count_services: bool, place: NetworkAddress, as_json: bool) -> None:
    """List the requests that ask or reply TYPE, as elea_msgs/Name. The status is 1 when there are none at present."""
    from deploy.live.connect import connect
    from deploy.live.message_types import canonical_type, record_by_type
    from deploy.live.output import write_json, write_note, write_text
    from deploy.live.services import list_services

    with connect(place.router, place.domain) as transport:
        found = list_services(transport)
    wanted = canonical_type(type_name)
    names = [each.name for each in found.values() if wanted in (each.asks, each.replies)]
    if not names:
        record_by_type(wanted)
        write_note(f"no request has {wanted} now")
    if as_json:
        write_json(names)
    else:
        write_text(f"{len(names)}\n" if count_services else "".join(f"{each}\n" for each in names))
    raise SystemExit(0 if names else 1)


@click.command("call", context_settings={"ignore_unknown_options": True})
@click.argument("service", type=SERVICE)
@click.argument("values", nargs=-1, metavar="[TYPE] [VALUES]...", type=TYPE_OR_VALUES)
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), default=5.0, show_default=True, metavar="S", help="Deadline."
)
@click.option("--flow-style", is_flag=True, help="The reply on one line.")
@network_options
@json_option
def call_command(
    service: str, values: tuple[str, ...], timeout: float, flow_style: bool, place: NetworkAddress, as_json: bool
) -> None:
    """Ask SERVICE. VALUES are YAML or JSON, as in '{name: tb3_0}', or the fields in their order.

    Fields left out have their defaults; TYPE is that of what is asked, and may be left out. The status is 1 when it is
    refused, with the reason, and when nobody answers in time.
    """
    from deploy.live.connect import connect
    from deploy.live.message_format import to_flow_yaml, to_yaml
    from deploy.live.output import write_json, write_text
    from deploy.live.services import call_service
    from deploy.live.topics import absolute_name

    name = absolute_name(service)
    with connect(place.router, place.domain) as transport:
        reply = call_service(transport, name, values, timeout)
    if as_json:
        write_json(reply)
    else:
        write_text(to_flow_yaml(reply) + "\n" if flow_style else to_yaml(reply))
