"""``elea tf tree``: all frames, who tells of them, how often, and how old the last word is."""

from __future__ import annotations

import click

from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("tree")
@click.option(
    "--listen",
    type=click.FloatRange(0.1, 600),
    default=1.5,
    show_default=True,
    metavar="S",
    help="Listen so long, by the wall clock.",
)
@json_option
@place_options
def command(place: Place, listen: float, as_json: bool) -> None:
    """Show the tree of frames on /tf and /tf_static.

    Rates and ages are in simulation time. The exit status is 1 when nobody tells of frames, and when the frames are no
    tree: one has two parents or two publishers, or they run in a circle.
    """
    from deploy.live.frame_tree import show_tree

    raise SystemExit(show_tree(place, listen, as_json))
