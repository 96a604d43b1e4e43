"""``elea tf echo``: where one frame lies in another, again and again."""

from __future__ import annotations

import click

from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("echo")
@click.argument("source")
@click.argument("target")
@click.option(
    "--rate",
    "-r",
    type=click.FloatRange(0.01, 100),
    default=1.0,
    show_default=True,
    metavar="HZ",
    help="Per second of simulation time.",
)
@click.option("--once", is_flag=True, help="End after the first one.")
@click.option("--count", "-n", type=click.IntRange(1), metavar="N", help="End after N.")
@click.option(
    "--timeout",
    type=click.FloatRange(0.1, 3600),
    default=3.0,
    show_default=True,
    metavar="S",
    help="Wait so long for the frames, by the wall clock.",
)
@json_option
@place_options
def command(
    place: Place,
    source: str,
    target: str,
    rate: float,
    once: bool,
    count: int | None,
    timeout: float,
    as_json: bool,
) -> None:
    """Show where the frame TARGET lies in the frame SOURCE: what takes data from TARGET to SOURCE, as tf_echo does.

    Translation in m, rotation as quaternion (x, y, z, w) and as roll, pitch, yaw about fixed axes. With --json, each is
    an object on a line.
    """
    from deploy.live.frame_echo import Terms, echo_frames

    terms = Terms(rate, 1 if once else count or 0, timeout, as_json)
    raise SystemExit(echo_frames(place, source, target, terms))
