"""``elea node`` and ``elea graph``: the nodes of the network."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import NODE
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import filter_option, fits, json_option, network_options
from services.runtime.network_address import NetworkAddress

if TYPE_CHECKING:
    from deploy.live.subscribers import HeartbeatSubscriber
    from services.runtime.graph import Entity

COMMANDS = {
    "list": LazyCommand("node:list_command", "List the running nodes."),
    "info": LazyCommand("node:info_command", "Show the topics, services and health of a node."),
    "ping": LazyCommand("node:ping_command", "Measure the round-trip time to a node's loop."),
}


@click.command("node", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """List nodes, show one or ping it. Queries the network directly; there is no daemon."""


@click.command("list")
@click.option("-a", "--all", "every", is_flag=True, help="Include tools, whose names begin with an underscore.")
@click.option("-c", "--count-nodes", is_flag=True, help="Show only their number.")
@filter_option
@network_options
@json_option
def list_command(every: bool, count_nodes: bool, pattern: str, address: NetworkAddress, as_json: bool) -> None:
    """List the running nodes."""
    from deploy.live.output import write_json, write_text
    from deploy.live.topics import is_hidden
    from services.runtime.graph import snapshot
    from services.runtime.light_node import open_transport

    with open_transport(address.router, address.domain) as transport:
        nodes = [each for each in snapshot(transport) if each.kind == "node" and fits(each.node, pattern)]
    found = [each for each in nodes if every or not is_hidden(each.node)]
    if as_json:
        write_json([{"node": each.node, "kind": each.name, "session": each.session} for each in found])
    elif count_nodes:
        write_text(f"{len(found)}\n")
    else:
        write_text("".join(f"{each.node}\n" for each in found))


@click.command("info")
@click.argument("node", type=NODE)
@network_options
@json_option
def info_command(node: str, address: NetworkAddress, as_json: bool) -> None:
    """Show what NODE publishes, subscribes to and serves, and its health from its next heartbeat."""
    from deploy.live.connect import cli_node
    from deploy.live.output import write_json, write_text
    from deploy.live.subscribers import collect_heartbeats
    from deploy.live.topics import absolute_name, not_found
    from services.runtime.graph import snapshot

    name = absolute_name(node)
    with cli_node(address, "info") as live:
        graph = snapshot(live.transport)
        own = [each for each in graph if each.node == name]
        if not own:
            raise not_found(
                "node", name, {each.node for each in graph if each.node != live.node}, "./elea node list shows them all"
            )
        description = _describe_node(name, own, collect_heartbeats(live, [name]))
    if as_json:
        write_json(description)
    else:
        write_text(_format_node(description))


def _describe_node(name: str, own: list[Entity], beats: HeartbeatSubscriber) -> dict[str, Any]:
    from deploy.live.subscribers import INPUT_COUNTS

    beat, inputs = beats.latest.get(name), beats.inputs(name)
    sent = {topic: each.sent for topic, each in beats.outputs(name).items()}
    period = next((int(each.detail) for each in own if each.kind == "step"), None)
    return {
        "node": name,
        "kind": next((each.name for each in own if each.kind == "node"), ""),
        "lockstep_period_s": None if period is None else period / 1e9,
        "health": None
        if beat is None
        else {"state": beat.state, "note": beat.note, "pid": beat.pid, "beat": beat.beat, "ticks": beat.ticks}
        | {name: getattr(beat, name) for name in (*INPUT_COUNTS, "sent")},
        "publishers": [
            {"topic": each.name, "type": each.record, "quality": each.detail.lower(), "sent": sent.get(each.name)}
            for each in own
            if each.kind == "pub"
        ],
        "subscribers": [
            {"topic": each.name, "type": each.record, "quality": each.detail.lower()}
            | {name: getattr(inputs.get(each.name), name, None) for name in INPUT_COUNTS}
            | {"reason": getattr(inputs.get(each.name), "reason", "")}
            for each in own
            if each.kind == "sub"
        ],
        "services": [{"name": each.name, "type": each.record} for each in own if each.kind == "srv"],
    }


def _format_node(description: dict[str, Any]) -> str:
    lines = [f"{description['node']}  ({description['kind']})"]
    health = description["health"]
    if health is None:
        lines.append("  no heartbeat: a tool, an external program, or a stuck loop")
    else:
        note = f" ({health['note']})" if health["note"] else ""
        lines.append(f"  {health['state']}{note}, pid {health['pid']}, {health['ticks']} ticks")
        lines.append(f"  total:{_format_counts(health | {'reason': ''})}, sent {health['sent']}")
    if description["lockstep_period_s"] is not None:
        lines.append(f"  steps with the simulation every {description['lockstep_period_s']:g} s")
    lines.append("  Subscribers:")
    lines += [f"    {each['topic']}: {each['type']}{_format_counts(each)}" for each in description["subscribers"]]
    lines.append("  Publishers:")
    for each in description["publishers"]:
        sent = "" if each["sent"] is None else f"  sent {each['sent']}"
        lines.append(f"    {each['topic']}: {each['type']}{sent}")
    lines.append("  Service Servers:")
    lines += [f"    {each['name']}: {each['type']}" for each in description["services"]]
    return "\n".join(lines) + "\n"


def _format_counts(row: dict[str, Any]) -> str:
    from deploy.live.subscribers import INPUT_COUNTS

    if row["received"] is None:
        return ""
    others = ", ".join(f"{name} {row[name]}" for name in INPUT_COUNTS[1:] if row[name])
    reason = f" ({row['reason']})" if row["reason"] else ""
    return f"  received {row['received']}{f', {others}' if others else ''}{reason}"


@click.command("ping")
@click.argument("node", type=NODE)
@click.option("-n", "--count", type=click.IntRange(1, 10_000), default=4, show_default=True, help="Number of pings.")
@click.option(
    "--interval",
    type=click.FloatRange(0, 60),
    default=1.0,
    show_default=True,
    metavar="S",
    help="Pause between pings, in seconds.",
)
@click.option(
    "--timeout",
    type=click.FloatRange(0, 60, min_open=True),
    default=2.0,
    show_default=True,
    metavar="S",
    help="Time to wait for each answer, in seconds.",
)
@network_options
@json_option
def ping_command(
    node: str, count: int, interval: float, timeout: float, address: NetworkAddress, as_json: bool
) -> None:
    """Measure the round-trip time to the loop of NODE [ms]: the network, and the wait for the loop's next turn.

    A hung loop does not answer, even if its process is alive. The exit status is 1 if no ping was answered.
    """
    from deploy.live.connect import cli_node
    from deploy.live.output import write_json, write_text
    from deploy.live.topics import absolute_name, not_found
    from services.runtime.graph import ping_key, snapshot

    name = absolute_name(node)
    with cli_node(address, "ping") as live:
        nodes = {each.node: each.session for each in snapshot(live.transport) if each.kind == "node"}
        if name not in nodes or name == live.node:
            raise not_found("node", name, nodes.keys() - {live.node}, "./elea node list shows them all")
        took: list[float | None] = []
        for number in range(count):
            if number:
                _sleep(live, interval)
            if live.stopping:
                break
            sent = time.monotonic()
            answered = any(each.ok for each in live.transport.query(ping_key(nodes[name], name), b"", timeout))
            took.append((time.monotonic() - sent) * 1e3 if answered else None)
            if not as_json:
                write_text(f"{name}: {'no answer' if took[-1] is None else f'{took[-1]:.2f} ms'}\n", flush=True)
    description = _summarize_pings(name, took)
    if as_json:
        write_json(description)
    elif description["answered"]:
        spread = (
            f"min {description['min_ms']:.2f}, mean {description['mean_ms']:.2f}, max {description['max_ms']:.2f} ms"
        )
        write_text(f"{description['answered']} of {description['sent']} answered: {spread}\n")
    else:
        write_text(f"0 of {description['sent']} answered: the loop hangs, or the node is a tool without a loop\n")
    raise SystemExit(0 if description["answered"] else 1)


def _sleep(live: Any, seconds: float) -> None:
    """Wait for the next ping, or until stopped."""
    end = time.monotonic() + seconds
    while not live.stopping and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, 0.1))


def _summarize_pings(name: str, took: list[float | None]) -> dict[str, Any]:
    came = [each for each in took if each is not None]
    return {
        "node": name,
        "sent": len(took),
        "answered": len(came),
        "min_ms": min(came, default=None),
        "mean_ms": sum(came) / len(came) if came else None,
        "max_ms": max(came, default=None),
        "round_trips_ms": took,
    }


@click.command("graph")
@filter_option
@network_options
@json_option
def graph_command(pattern: str, address: NetworkAddress, as_json: bool) -> None:
    """List every node with its publishers, subscribers and services."""
    from deploy.live.output import write_json, write_text
    from services.runtime.graph import snapshot
    from services.runtime.light_node import open_transport

    with open_transport(address.router, address.domain) as transport:
        entities = [each for each in snapshot(transport) if fits(each.node, pattern)]
    if as_json:
        write_json([asdict(each) for each in entities])
    else:
        write_text(_format_graph(entities))


def _format_graph(entities: list[Entity]) -> str:
    """Format each node with its endpoints, each topic with type and quality."""
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
    return "\n".join(lines) + "\n" if lines else "no nodes\n"
