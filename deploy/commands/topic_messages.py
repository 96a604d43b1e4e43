"""``elea topic echo``, ``hz``, ``bw``, ``delay`` and ``pub``: the messages of topics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import FIELD, TOPIC, TYPE, TYPE_OR_VALUES
from deploy.commands.options import json_option, network_options
from deploy.commands.topic import measure_options, timeout_option, topic_argument, wait_option
from services.runtime.network_address import NetworkAddress

if TYPE_CHECKING:
    from deploy.live.measure import MeasureOptions


@click.command("echo")
@topic_argument
@click.argument("type_name", metavar="[TYPE]", default="", type=TYPE)
@click.option("--once", is_flag=True, help="End after one message.")
@click.option("-n", "--count", type=click.IntRange(1), help="End after N messages.")
@click.option(
    "--field",
    "fields",
    multiple=True,
    type=FIELD,
    help="Print only this field, e.g. pose.pose.position or ranges[0]; repeatable.",
)
@click.option("--csv", "-p", "as_csv", is_flag=True, help="Print CSV: a header row, then a row per message.")
@click.option("--no-header", is_flag=True, help="Print CSV without the header row.")
@click.option("--no-arr", "--noarr", is_flag=True, help="Print only the length of arrays.")
@click.option("--no-str", "--nostr", is_flag=True, help="Print only the length of strings.")
@click.option("-f", "--full-length", is_flag=True, help="Do not truncate arrays and strings; CSV and JSON never are.")
@click.option(
    "-l", "--truncate-length", type=click.IntRange(1), help="Elements after which arrays are truncated; 128 by default."
)
@click.option("--flow-style", is_flag=True, help="Print each message on one line.")
@click.option(
    "--include-message-info", "with_info", is_flag=True, help="Print the number, publisher and times of each message."
)
@timeout_option
@wait_option
@network_options
@json_option
def echo_command(
    topic: str,
    type_name: str,
    once: bool,
    count: int | None,
    fields: tuple[str, ...],
    timeout: float | None,
    wait: bool,
    address: NetworkAddress,
    as_json: bool,
    **style: Any,
) -> None:
    """Print the messages of TOPIC as YAML until Ctrl-C; with --json, one per line.

    TYPE is needed only if the publisher does not declare it. Unknown types are printed, too. With --timeout, the exit
    status is 1 if the messages did not arrive in time.
    """
    from deploy.live.echo import EchoFormat, EchoRequest, echo
    from services.runtime.errors import BadInput

    if as_json and style["as_csv"]:
        raise BadInput("--json and --csv exclude each other")
    if once and count not in (None, 1):
        raise BadInput(f"--once and -n {count} exclude each other")
    most = style.pop("truncate_length")
    asked = EchoRequest(topic, type_name, fields, 1 if once else count or 0, timeout, wait)
    raise SystemExit(echo(address, asked, EchoFormat(as_json=as_json, max_elements=most, **style)))


@click.command("hz")
@click.argument("topics", type=TOPIC, nargs=-1, required=True)
@measure_options(10_000)
def hz_command(topics: tuple[str, ...], window: int, options: MeasureOptions, address: NetworkAddress) -> None:
    """Measure the rate of TOPICS in simulation time and wall time until Ctrl-C.

    Simulation time is that of the message header, or of /clock when the message was sent. Lost messages, known from
    gaps in the sequence numbers, count towards the rate and are shown.
    """
    from deploy.live.measure import measure
    from deploy.live.topic_statistics import HzMeter

    raise SystemExit(measure(address, "hz", topics, lambda name: HzMeter(name, window), options))


@click.command("bw")
@click.argument("topics", type=TOPIC, nargs=-1, required=True)
@measure_options(100)
def bw_command(topics: tuple[str, ...], window: int, options: MeasureOptions, address: NetworkAddress) -> None:
    """Measure the payload bandwidth of TOPICS in bytes per second until Ctrl-C.

    Each message adds 33 bytes to its payload, and the network its own overhead.
    """
    from deploy.live.measure import measure
    from deploy.live.topic_statistics import BwMeter

    raise SystemExit(measure(address, "bw", topics, lambda name: BwMeter(name, window), options))


@click.command("delay")
@topic_argument
@measure_options(10_000)
def delay_command(topic: str, window: int, options: MeasureOptions, address: NetworkAddress) -> None:
    """Measure the age of the messages of TOPIC on arrival until Ctrl-C.

    In simulation time, from the header stamp to the last /clock, which is published every 20 ms; and in wall time, from
    the time of sending that every message carries: exact on one machine.
    """
    from deploy.live.measure import measure
    from deploy.live.topic_statistics import DelayMeter

    raise SystemExit(measure(address, "delay", (topic,), lambda name: DelayMeter(name, window), options))


@click.command("pub", context_settings={"ignore_unknown_options": True})
@topic_argument
@click.argument("values", nargs=-1, metavar="[TYPE] [VALUES]...", type=TYPE_OR_VALUES)
@click.option("-r", "--rate", type=click.FloatRange(0, 1000, min_open=True), metavar="HZ", help="Messages per second.")
@click.option("-1", "--once", is_flag=True, help="Publish one message and exit.")
@click.option("-t", "--times", type=click.IntRange(1), metavar="N", help="End after N messages.")
@click.option(
    "-w",
    "--wait-matching",
    "--wait-matching-subscriptions",
    "wait_matching",
    type=click.IntRange(0),
    metavar="N",
    help="Wait for N subscribers first; by default 1 with --once or -t, else 0.",
)
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), metavar="S", help="Give up waiting after S seconds."
)
@click.option(
    "--stamp",
    type=click.Choice(["now", "zero"]),
    default="now",
    show_default=True,
    help="Stamp headers without a stamp with simulation time, or leave them at zero.",
)
@click.option("--wall-time", is_flag=True, help="Publish by wall time; by default by /clock, if it is published.")
@click.option(
    "--keep-alive",
    type=click.FloatRange(0, 3600),
    default=0.1,
    metavar="S",
    help="Stay connected for S seconds after the last message.",
)
@click.option("-q", "--quiet", is_flag=True, help="Do not print the messages.")
@network_options
@json_option
def pub_command(
    topic: str,
    values: tuple[str, ...],
    rate: float | None,
    once: bool,
    times: int | None,
    wait_matching: int | None,
    timeout: float | None,
    stamp: str,
    wall_time: bool,
    keep_alive: float,
    quiet: bool,
    address: NetworkAddress,
    as_json: bool,
) -> None:
    """Publish messages on TOPIC.

    VALUES are YAML or JSON, e.g. '{linear: {x: 0.1}}', or the fields in order, e.g. '[0.1, 0, 0]' '[0, 0, 1]'.
    Omitted fields have their defaults. TYPE, e.g. geometry_msgs/Twist, may be omitted for a known topic.
    Without -r, --once or -t, commands are published at their promised rate, latched messages once and held, all others
    once a second, until Ctrl-C. A base stops when its commands stop.
    """
    from deploy.live.publish import PublishRequest, publish
    from services.runtime.errors import BadInput

    if once and times not in (None, 1):
        raise BadInput(f"--once and -t {times} exclude each other")
    count = 1 if once else times or 0
    asked = PublishRequest(
        topic=topic,
        values=values,
        rate=rate,
        count=count,
        min_subscribers=(1 if count else 0) if wait_matching is None else wait_matching,
        timeout=timeout,
        stamped=stamp == "now",
        wall_time=wall_time,
        keep_alive=keep_alive,
    )
    raise SystemExit(publish(address, asked, "" if quiet else "json" if as_json else "text"))
