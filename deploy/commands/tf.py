"""``elea tf``: show the frame tree, or the transform between two frames."""

from __future__ import annotations

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option, network_options
from services.runtime.network_address import NetworkAddress

COMMANDS = {
    "tree": LazyCommand("tf:tree_command", "Show all frames with their publishers, rates and ages."),
    "echo": LazyCommand("tf:echo_command", "Print the transform between two frames."),
}


@click.command("tf", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """Show the frame tree, or the transform between two frames. Queries the network directly; there is no daemon."""


@click.command("tree")
@click.option(
    "--listen",
    type=click.FloatRange(0.1, 600),
    default=1.5,
    show_default=True,
    metavar="S",
    help="Wall time to listen, in seconds.",
)
@json_option
@network_options
def tree_command(address: NetworkAddress, listen: float, as_json: bool) -> None:
    """Show the frame tree on /tf and /tf_static.

    Rates and ages are in simulation time. The exit status is 1 if there are no frames, or if they do not form a tree:
    a frame has two parents or two publishers, or there is a loop.
    """
    from deploy.live.tf import show_tree

    raise SystemExit(show_tree(address, listen, as_json))


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
    help="Transforms per second of simulation time.",
)
@click.option("--once", is_flag=True, help="Exit after the first transform.")
@click.option("--count", "-n", type=click.IntRange(1), metavar="N", help="Exit after N transforms.")
@click.option(
    "--timeout",
    type=click.FloatRange(0.1, 3600),
    default=3.0,
    show_default=True,
    metavar="S",
    help="Wall time to wait for the frames, in seconds.",
)
@json_option
@network_options
def echo_command(
    address: NetworkAddress,
    source: str,
    target: str,
    rate: float,
    once: bool,
    count: int | None,
    timeout: float,
    as_json: bool,
) -> None:
    """Print the pose of frame TARGET in frame SOURCE, which transforms data from TARGET to SOURCE, as tf_echo does.

    Translation in m, rotation as quaternion (x, y, z, w) and as roll, pitch, yaw about fixed axes. With --json, one
    object per line.
    """
    from deploy.live.tf import TfEchoOptions, echo_transform

    options = TfEchoOptions(rate, 1 if once else count or 0, timeout, as_json)
    raise SystemExit(echo_transform(address, source, target, options))
