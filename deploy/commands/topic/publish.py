"""``elea topic pub``: messages from the command line."""

from __future__ import annotations

import click

from deploy.commands.completion import TYPE_OR_VALUES
from deploy.commands.options import json_option, place_options
from deploy.commands.topic.shared import topic_argument
from deploy.place import Place


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
@place_options
@json_option
def command(
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
    place: Place,
    as_json: bool,
) -> None:
    """Publish on TOPIC.

    VALUES are YAML or JSON: '{linear: {x: 0.1}}', or the fields in their order: '[0.1, 0, 0]' '[0, 0, 1]'.
    Fields left out have their defaults. TYPE, as geometry_msgs/Twist, may be left out where the topic is known.
    Without -r, --once and -t: a command is sent at its promised rate, what is latched once and held, everything else
    once a second, until Ctrl-C. A base stops when its commands stop.
    """
    from deploy.live.publish import Publication, publish
    from services.runtime.errors import BadInput

    if once and times not in (None, 1):
        raise BadInput(f"--once and -t {times} exclude each other")
    count = 1 if once else times or 0
    asked = Publication(
        topic=topic,
        values=values,
        rate=rate,
        count=count,
        matching=(1 if count else 0) if wait_matching is None else wait_matching,
        timeout=timeout,
        stamped=stamp == "now",
        wall_time=wall_time,
        keep_alive=keep_alive,
    )
    raise SystemExit(publish(place, asked, "" if quiet else "json" if as_json else "text"))
