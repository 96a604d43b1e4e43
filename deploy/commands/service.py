"""``elea service``: list, describe and call services."""

from __future__ import annotations

import click

from deploy.commands.completion import SERVICE, TYPE, TYPE_OR_VALUES
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option, network_options
from services.runtime.network_address import NetworkAddress

COMMANDS = {
    "list": LazyCommand("service:list_command", "List the services on the network."),
    "type": LazyCommand("service:type_command", "Show the request and response types of a service."),
    "find": LazyCommand("service:find_command", "List the services of a type."),
    "call": LazyCommand("service:call_command", "Call a service and print its response."),
}


@click.command("service", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """List services or call one. Queries the network directly; there is no daemon."""


@click.command("list")
@click.option("-t", "--show-types", is_flag=True, help="Show request and response types.")
@click.option("-v", "--verbose", is_flag=True, help="Show types, nodes and descriptions.")
@click.option("-c", "--count-services", is_flag=True, help="Show only their number.")
@network_options
@json_option
def list_command(show_types: bool, verbose: bool, count_services: bool, address: NetworkAddress, as_json: bool) -> None:
    """List the services on the network."""
    from deploy.live.output import write_json, write_text
    from deploy.live.services import list_services
    from services.runtime.light_node import open_transport

    with open_transport(address.router, address.domain) as transport:
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
def type_command(service: str, address: NetworkAddress, as_json: bool) -> None:
    """Show the request and response types of SERVICE."""
    from deploy.live.output import write_json, write_text
    from deploy.live.services import find_service
    from deploy.live.topics import absolute_name
    from services.runtime.light_node import open_transport

    name = absolute_name(service)
    with open_transport(address.router, address.domain) as transport:
        found = find_service(transport, name)
    if as_json:
        write_json(found.as_dict())
    else:
        write_text(f"{found.types}\n")


@click.command("find")
@click.argument("type_name", metavar="TYPE", type=TYPE)
@click.option("-c", "--count-services", is_flag=True, help="Show only their number.")
@network_options
@json_option
def find_command(type_name: str, count_services: bool, address: NetworkAddress, as_json: bool) -> None:
    """List the services with request or response TYPE, e.g. elea_msgs/Name. The exit status is 1 if there are none."""
    from deploy.interfaces import canonical_type, record_by_type
    from deploy.live.output import write_json, write_note, write_text
    from deploy.live.services import list_services
    from services.runtime.light_node import open_transport

    with open_transport(address.router, address.domain) as transport:
        found = list_services(transport)
    wanted = canonical_type(type_name)
    names = [each.name for each in found.values() if wanted in (each.asks, each.replies)]
    if not names:
        record_by_type(wanted)
        write_note(f"no running service has the type {wanted}")
    if as_json:
        write_json(names)
    else:
        write_text(f"{len(names)}\n" if count_services else "".join(f"{each}\n" for each in names))
    raise SystemExit(0 if names else 1)


@click.command("call", context_settings={"ignore_unknown_options": True})
@click.argument("service", type=SERVICE)
@click.argument("values", nargs=-1, metavar="[TYPE] [VALUES]...", type=TYPE_OR_VALUES)
@click.option(
    "--timeout",
    type=click.FloatRange(0, min_open=True),
    default=5.0,
    show_default=True,
    metavar="S",
    help="Time to wait for the response, in seconds.",
)
@click.option("--flow-style", is_flag=True, help="Print the response on one line.")
@network_options
@json_option
def call_command(
    service: str, values: tuple[str, ...], timeout: float, flow_style: bool, address: NetworkAddress, as_json: bool
) -> None:
    """Call SERVICE. VALUES are YAML or JSON, e.g. '{name: tb3_0}', or the fields in order.

    Omitted fields have their defaults; TYPE is the request type, and may be omitted. The exit status is 1 if the
    request is refused or not answered in time.
    """
    from deploy.live.message_format import to_flow_yaml, to_yaml
    from deploy.live.output import write_json, write_text
    from deploy.live.services import call_service
    from deploy.live.topics import absolute_name
    from services.runtime.light_node import open_transport

    name = absolute_name(service)
    with open_transport(address.router, address.domain) as transport:
        reply = call_service(transport, name, values, timeout)
    if as_json:
        write_json(reply)
    else:
        write_text(to_flow_yaml(reply) + "\n" if flow_style else to_yaml(reply))
