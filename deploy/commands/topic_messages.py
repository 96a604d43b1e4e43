"""``elea topic echo``, ``hz``, ``bw``, ``delay`` and ``pub``: the messages of topics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import FIELD, TOPIC, TYPE, TYPE_OR_VALUES
from deploy.commands.options import json_option, network_options
from deploy.commands.topic import measure_options, timeout_option, topic_argument, wait_option
from deploy.network_address import NetworkAddress

if TYPE_CHECKING:
    from deploy.live.measure import MeasureOptions


@click.command("echo")
@topic_argument
@click.argument("type_name", metavar="[TYPE]", default="", type=TYPE)
@click.option("--once", is_flag=True, help="End after one message.")
@click.option("-n", "--count", type=click.IntRange(1), help="End after N messages.")
@click.option("--field", "fields", multiple=True, type=FIELD, help="A part: pose.pose.position, ranges[0]; repeatable.")
@click.option("--csv", "-p", "as_csv", is_flag=True, help="A row of CSV for each message, below a row of names.")
@click.option("--no-header", is_flag=True, help="CSV without the row of names.")
@click.option("--no-arr", "--noarr", is_flag=True, help="Lists by their length alone.")
@click.option("--no-str", "--nostr", is_flag=True, help="Texts by their length alone.")
@click.option("-f", "--full-length", is_flag=True, help="Lists and texts in full length; CSV and JSON are so anyway.")
@click.option("-l", "--truncate-length", type=click.IntRange(1), help="Elements shown of a list; 128 by default.")
@click.option("--flow-style", is_flag=True, help="Each message on one line.")
@click.option("--include-message-info", "with_info", is_flag=True, help="Show number, sender and times of each sample.")
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
    place: NetworkAddress,
    as_json: bool,
    **style: Any,
) -> None:
    """Show the messages of TOPIC as YAML, until Ctrl-C; with --json, each as one line.

    TYPE is needed only for a sender that does not tell it. What is of a type that is not known here is shown all the
    same. With --timeout the status is 1 when the messages did not come in time.
    """
    from deploy.live.echo import EchoFormat, EchoRequest, echo
    from services.runtime.errors import BadInput

    if as_json and style["as_csv"]:
        raise BadInput("--json and --csv exclude each other")
    if once and count not in (None, 1):
        raise BadInput(f"--once and -n {count} exclude each other")
    most = style.pop("truncate_length")
    asked = EchoRequest(topic, type_name, fields, 1 if once else count or 0, timeout, wait)
    raise SystemExit(echo(place, asked, EchoFormat(as_json=as_json, max_elements=most, **style)))


@click.command("hz")
@click.argument("topics", type=TOPIC, nargs=-1, required=True)
@measure_options(10_000)
def hz_command(topics: tuple[str, ...], window: int, terms: MeasureOptions, place: NetworkAddress) -> None:
    """Measure the rate of TOPICS, by simulation time and by the wall clock, until Ctrl-C.

    Simulation time is that of a message's header, without one that of /clock when it was sent. Messages that were lost
    on the way are known by their numbers: they are counted in the rate, and shown.
    """
    from deploy.live.measure import measure
    from deploy.live.topic_statistics import HzMeter

    raise SystemExit(measure(place, "hz", topics, lambda name: HzMeter(name, window), terms))


@click.command("bw")
@click.argument("topics", type=TOPIC, nargs=-1, required=True)
@measure_options(100)
def bw_command(topics: tuple[str, ...], window: int, terms: MeasureOptions, place: NetworkAddress) -> None:
    """Measure the bytes of payload that each of TOPICS takes each second, until Ctrl-C.

    Each sample has 33 bytes more beside its payload, and what the network adds.
    """
    from deploy.live.measure import measure
    from deploy.live.topic_statistics import BwMeter

    raise SystemExit(measure(place, "bw", topics, lambda name: BwMeter(name, window), terms))


@click.command("delay")
@topic_argument
@measure_options(10_000)
def delay_command(topic: str, window: int, terms: MeasureOptions, place: NetworkAddress) -> None:
    """Measure how old the messages of TOPIC are when they arrive, until Ctrl-C.

    Once by simulation time, from the stamp in the header to the last /clock, which comes every 20 ms; and once by the
    wall clock, from the sending, whose time every sample bears: exact on one machine.
    """
    from deploy.live.measure import measure
    from deploy.live.topic_statistics import DelayMeter

    raise SystemExit(measure(place, "delay", (topic,), lambda name: DelayMeter(name, window), terms))


@click.command("pub", context_settings={"ignore_unknown_options": True})
@topic_argument
@click.argument("values", nargs=-1, metavar="[TYPE] [VALUES]...", type=TYPE_OR_VALUES)
@click.option("-r", "--rate", type=click.FloatRange(0, 1000, min_open=True), metavar="HZ", help="Messages per second.")
@click.option("-1", "--once", is_flag=True, help="Send one message and end.")
@click.option("-t", "--times", type=click.IntRange(1), metavar="N", help="End after N messages.")
@click.option(
    "-w",
    "--wait-matching",
    "--wait-matching-subscriptions",
    "wait_matching",
    type=click.IntRange(0),
    metavar="N",
    help="Wait for N subscribers first; 1 by default with --once and -t, else 0.",
)
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), metavar="S", help="Give up waiting after S seconds."
)
@click.option(
    "--stamp",
    type=click.Choice(["now", "zero"]),
    default="now",
    show_default=True,
    help="Headers without a stamp get simulation time, or stay at zero.",
)
@click.option("--wall-time", is_flag=True, help="Count the rate by the wall clock; by default by /clock, if it runs.")
@click.option("--keep-alive", type=click.FloatRange(0, 3600), default=0.1, metavar="S", help="Stay S after the last.")
@click.option("-q", "--quiet", is_flag=True, help="Do not show what is sent.")
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
    place: NetworkAddress,
    as_json: bool,
) -> None:
    """Publish on TOPIC.

    VALUES are YAML or JSON: '{linear: {x: 0.1}}', or the fields in their order: '[0.1, 0, 0]' '[0, 0, 1]'.
    Fields left out have their defaults. TYPE, as geometry_msgs/Twist, may be left out where the topic is known.
    Without -r, --once and -t: a command is sent at its promised rate, what is latched once and held, everything else
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
    raise SystemExit(publish(place, asked, "" if quiet else "json" if as_json else "text"))
