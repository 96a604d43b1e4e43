"""``elea topic``: list and describe topics."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import TOPIC, TYPE
from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import filter_option, fits, json_option, network_options
from deploy.live.connect import spin
from services.runtime.network_address import NetworkAddress

if TYPE_CHECKING:
    from deploy.live.topics import TopicEndpoints
    from services.runtime.light_node import LightNode

COMMANDS = {
    "list": LazyCommand("topic:list_command", "List the topics of the network."),
    "echo": LazyCommand("topic_messages:echo_command", "Show the messages of a topic."),
    "hz": LazyCommand("topic_messages:hz_command", "Measure the rate of topics."),
    "bw": LazyCommand("topic_messages:bw_command", "Measure the bandwidth of a topic."),
    "delay": LazyCommand("topic_messages:delay_command", "Measure the delay of a topic."),
    "info": LazyCommand("topic:info_command", "Show the type, publishers and subscribers of a topic."),
    "pub": LazyCommand("topic_messages:pub_command", "Publish messages."),
    "find": LazyCommand("topic:find_command", "List the topics of a type."),
    "type": LazyCommand("topic:type_command", "Show the type of a topic."),
}


@click.command("topic", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """List, show, measure and publish topics. Queries the network directly; there is no daemon."""


topic_argument: Callable[[Any], Any] = click.argument("topic", type=TOPIC)

wait_option: Callable[[Any], Any] = click.option(
    "--wait", is_flag=True, help="Wait for a topic that does not exist yet instead of failing."
)
timeout_option: Callable[[Any], Any] = click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), metavar="S", help="End after S seconds of wall time."
)


def measure_options(window: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add the options of a measuring command, which gets ``address``, ``window`` and ``options``."""

    def decorate(verb: Callable[..., Any]) -> Callable[..., Any]:
        @click.option(
            "-w",
            "--window",
            type=click.IntRange(2),
            default=window,
            show_default=True,
            help="Number of newest messages to average over.",
        )
        @click.option("-n", "--count", type=click.IntRange(1), default=None, help="End after N messages of each topic.")
        @timeout_option
        @wait_option
        @network_options
        @json_option
        @functools.wraps(verb)
        def measured(count: int | None, timeout: float | None, wait: bool, as_json: bool, **values: Any) -> Any:
            from deploy.live.measure import MeasureOptions

            return verb(options=MeasureOptions(count or 0, timeout, wait, as_json), **values)

        made: Callable[..., Any] = measured
        return made

    return decorate


@click.command("list")
@click.option("-t", "--show-types", is_flag=True, help="Show the types.")
@click.option("-v", "--verbose", is_flag=True, help="Show types, qualities, publishers and subscribers.")
@click.option("-c", "--count-topics", is_flag=True, help="Show only their number.")
@click.option(
    "--listen",
    type=click.FloatRange(0, 60),
    default=0.0,
    metavar="S",
    help="Listen for S seconds for undeclared topics.",
)
@filter_option
@network_options
@json_option
def list_command(
    show_types: bool,
    verbose: bool,
    count_topics: bool,
    listen: float,
    pattern: str,
    address: NetworkAddress,
    as_json: bool,
) -> None:
    """List the topics that have publishers or subscribers.

    External programs do not declare their topics: --listen also shows topics on which they publish meanwhile.
    """
    from deploy.live.connect import cli_node
    from deploy.live.output import write_json, write_text
    from deploy.live.topics import group_by_topic
    from services.runtime.graph import snapshot

    with cli_node(address, "list") as live:
        found = group_by_topic(snapshot(live.transport))
        foreign = _foreign_topics(live, listen) if listen else {}
    rows = [_topic_row(each) for each in found.values()]
    rows += [{**_empty_row(name), "types": types} for name, types in foreign.items() if name not in found]
    rows = sorted((each for each in rows if fits(each["name"], pattern)), key=lambda each: str(each["name"]))
    if as_json:
        write_json(rows)
    elif count_topics:
        write_text(f"{len(rows)}\n")
    else:
        write_text("".join(_format_row(each, show_types, verbose) for each in rows))


def _foreign_topics(live: LightNode, seconds: float) -> dict[str, list[str]]:
    """Return topics on which external programs publish, with the types they declare."""
    from messages.names import BadName, name_of
    from services.runtime.transport.wire import FORMAT, unpack_attachment

    inlet, found = live.transport.subscribe("**", 8192), dict[str, list[str]]()
    for _ in spin(live, inlet, seconds):
        while (sample := inlet.recv()) is not None:
            _, attachment, source = sample
            if unpack_attachment(attachment) is not None:
                continue
            try:
                types = found.setdefault(name_of(inlet.key(source)), [])
            except BadName:
                continue
            form, _, type_name = inlet.encoding(source).partition(";")
            if form == FORMAT and type_name and type_name not in types:
                types.append(type_name)
    return found


def _empty_row(name: str) -> dict[str, Any]:
    from deploy.interfaces import known_topic

    known = known_topic(name)
    return {
        "name": name,
        "types": [],
        "quality": "",
        "promised": known.rate if known is not None and known.rate else None,
        "about": known.about if known is not None else "",
        "publishers": [],
        "subscribers": [],
    }


def _topic_row(ends: TopicEndpoints) -> dict[str, Any]:
    from deploy.live.topics import is_hidden

    shown = [each for each in ends.subscribers if not is_hidden(each.node)]
    return {
        **_empty_row(ends.name),
        "types": list(ends.types),
        "quality": next((each.detail.lower() for each in (*ends.publishers, *ends.subscribers)), ""),
        "publishers": [each.node for each in ends.publishers],
        "subscribers": [each.node for each in shown],
    }


def _format_row(row: dict[str, Any], types: bool, verbose: bool) -> str:
    kinds = ", ".join(row["types"]) or "?"
    if not verbose:
        return f"{row['name']} [{kinds}]\n" if types else f"{row['name']}\n"
    quality = f", {row['quality']}" if row["quality"] else ", foreign"
    promised = f", {row['promised']:g} Hz" if row["promised"] else ""
    ends = "".join(
        f"  {arrow} {', '.join(row[side])}\n"
        for arrow, side in (("<-", "publishers"), ("->", "subscribers"))
        if row[side]
    )
    return f"{row['name']} [{kinds}{quality}{promised}]\n{ends}"


_LISTEN_S = 1.2
"""Wall time [s] to measure rates and to wait for heartbeats, which are published once per second."""


@click.command("info")
@topic_argument
@click.option(
    "-v",
    "--verbose",
    is_flag=True,
    help="Listen for a second to show nodes, qualities, rates, losses and external publishers.",
)
@network_options
@json_option
def info_command(topic: str, verbose: bool, address: NetworkAddress, as_json: bool) -> None:
    """Show the type, publishers and subscribers of TOPIC."""
    from deploy.live.connect import cli_node
    from deploy.live.output import write_json, write_text
    from deploy.live.topics import absolute_name, find_topic

    name = absolute_name(topic)
    with cli_node(address, "info") as live:
        description = _describe_topic(find_topic(live, name), live, verbose)
    if as_json:
        write_json(description)
    else:
        write_text(_format_topic(description, verbose))


def _describe_topic(ends: TopicEndpoints, live: LightNode, verbose: bool) -> dict[str, Any]:
    from deploy.interfaces import known_topic

    known = known_topic(ends.name)
    description: dict[str, Any] = {
        "topic": ends.name,
        "types": list(ends.types),
        "quality": next((each.detail.lower() for each in (*ends.publishers, *ends.subscribers)), None),
        "promised": known.rate if known is not None and known.rate else None,
        "about": known.about if known is not None else "",
        "publishers": [
            {"node": each.node, "type": each.record, "quality": each.detail.lower()} for each in ends.publishers
        ],
        "subscribers": [
            {"node": each.node, "type": each.record, "quality": each.detail.lower()} for each in ends.subscribers
        ],
    }
    if verbose:
        _add_measurements(description, ends, live)
    return description


def _add_measurements(description: dict[str, Any], ends: TopicEndpoints, live: LightNode) -> None:
    """Add the rates of publishers and the counts in heartbeats, measured for a second."""
    from deploy.live.subscribers import INPUT_COUNTS, ClockSubscriber, HeartbeatSubscriber
    from deploy.live.topic_statistics import RateSample, SampleWindow
    from deploy.live.topics import is_latched
    from messages.names import key as key_of
    from services.runtime.subscriber import UntypedSubscriber
    from services.runtime.transport.wire import MEMBER_BYTES, member_id, publisher_id

    beats, clock = HeartbeatSubscriber(live), ClockSubscriber(live.transport)
    listener, foreign = UntypedSubscriber(live.transport, ends.name, is_latched(ends)), list[str]()
    windows: dict[bytes, SampleWindow] = {}
    for _ in spin(live, listener.raw, _LISTEN_S):
        beats.update()
        clock.update()
        for received in listener.drain():
            sender = b"" if received.origin is None else received.origin.publisher
            sample = RateSample(clock.sample_time(received), received.sent_ns, received.lost, len(received.payload))
            windows.setdefault(sender, SampleWindow(100_000)).add(sample)
            if not sender and (received.type or "?") not in foreign:
                foreign.append(received.type or "?")
    for row, entity in zip(description["publishers"], ends.publishers, strict=True):
        window = windows.pop(publisher_id(entity.node, entity.session, key_of(entity.name)), None)
        row |= _rates(window)
        row["sent"] = getattr(beats.outputs(entity.node).get(ends.name), "sent", None)
    members = {member_id(each.node, each.session): each.node for each in ends.publishers}
    for sender, window in windows.items():
        kind = ", ".join(foreign) if not sender else "?"
        # A node that plays back what several nodes had latched has one publisher for each of them.
        again = members.get(sender[:MEMBER_BYTES])
        node = "(foreign)" if not sender else again or f"(undeclared {sender.hex()})"
        description["publishers"].append({"node": node, "type": kind, "quality": "-", **_rates(window), "sent": None})
    for row in description["subscribers"]:
        row["beats"] = row["node"] in beats.latest
        own = beats.inputs(row["node"]).get(ends.name)
        for name in (*INPUT_COUNTS, "reason"):
            row[name] = getattr(own, name, None)


def _rates(window: Any) -> dict[str, Any]:
    simulated, wall = (None, None) if window is None else (window.sim_rate(), window.wall_rate())
    return {
        "hz": None if simulated is None else simulated.hz,
        "wall_hz": None if wall is None else wall.hz,
        "lost": 0 if window is None else window.lost,
    }


def _format_topic(description: dict[str, Any], verbose: bool) -> str:
    publishers, subscribers = description["publishers"], description["subscribers"]
    lines = [f"Type: {', '.join(description['types']) or '?'}"]
    if description["about"]:
        lines.append(f"About: {description['about']}")
    lines.append(f"Quality: {description['quality'] or '?'}")
    if description["promised"]:
        lines.append(f"Promised rate: {description['promised']:g} Hz")
    lines.append(f"Publisher count: {len(publishers)}")
    lines += [_format_publisher(each) for each in publishers if verbose]
    lines.append(f"Subscription count: {len(subscribers)}")
    lines += [_format_subscriber(each) for each in subscribers if verbose]
    return "\n".join(lines) + "\n"


def _format_publisher(row: dict[str, Any]) -> str:
    rate = "silent for a second" if row["wall_hz"] is None else f"{row['wall_hz']:.1f} Hz by the wall clock"
    rate += "" if row["hz"] is None else f", {row['hz']:.1f} Hz simulated"
    sent = "" if row["sent"] is None else f", sent {row['sent']}"
    lost = f", {row['lost']} lost on the way here" if row["lost"] else ""
    return f"  {row['node']}  [{row['type']}, {row['quality']}]  {rate}{sent}{lost}"


def _format_subscriber(row: dict[str, Any]) -> str:
    if row["received"] is None:
        from deploy.live.topics import is_hidden

        silent = "a short-lived tool" if is_hidden(row["node"]) else "no heartbeat for a second"
        if row["beats"]:
            silent = f"it has too many topics to list this one: ./elea node info {row['node']}"
        return f"  {row['node']}  [{row['type']}, {row['quality']}]  {silent}"
    from deploy.live.subscribers import INPUT_COUNTS

    shown = [name for name in INPUT_COUNTS if row[name] or name not in ("repeated", "resynced")]
    counts = ", ".join(f"{name} {row[name]}" for name in shown)
    reason = f" ({row['reason']})" if row["reason"] else ""
    return f"  {row['node']}  [{row['type']}, {row['quality']}]  {counts}{reason}"


@click.command("find")
@click.argument("type_name", metavar="TYPE", type=TYPE)
@click.option("-c", "--count-topics", is_flag=True, help="Show only their number.")
@network_options
@json_option
def find_command(type_name: str, count_topics: bool, address: NetworkAddress, as_json: bool) -> None:
    """List the topics of TYPE, e.g. geometry_msgs/Twist. The exit status is 1 if there are none."""
    from deploy.interfaces import canonical_type, record_by_type
    from deploy.live.output import write_json, write_note, write_text
    from deploy.live.topics import group_by_topic
    from services.runtime.graph import snapshot
    from services.runtime.light_node import open_transport

    with open_transport(address.router, address.domain) as transport:
        found = group_by_topic(snapshot(transport))
    wanted = canonical_type(type_name)
    names = [each.name for each in found.values() if wanted in each.types]
    if not names:
        record_by_type(wanted)
        write_note(f"no topic has the type {wanted} now")
    if as_json:
        write_json(names)
    else:
        write_text(f"{len(names)}\n" if count_topics else "".join(f"{each}\n" for each in names))
    raise SystemExit(0 if names else 1)


@click.command("type")
@topic_argument
@network_options
@json_option
def type_command(topic: str, address: NetworkAddress, as_json: bool) -> None:
    """Show the type of TOPIC, or all types if its publishers and subscribers disagree."""
    from deploy.live.output import write_json, write_text
    from deploy.live.topics import absolute_name, group_by_topic, not_found
    from services.runtime.graph import snapshot
    from services.runtime.light_node import open_transport

    name = absolute_name(topic)
    with open_transport(address.router, address.domain) as transport:
        found = group_by_topic(snapshot(transport))
    if name not in found:
        raise not_found("topic", name, found, "./elea topic list shows them all")
    types = found[name].types
    if as_json:
        write_json({"topic": name, "types": types})
    else:
        write_text("".join(f"{each}\n" for each in types))
