"""``elea topic hz``: how often topics come."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from deploy.commands.completion import TOPIC
from deploy.commands.topic.shared import measuring
from deploy.place import Place

if TYPE_CHECKING:
    from deploy.live.measure import Terms


@click.command("hz")
@click.argument("topics", type=TOPIC, nargs=-1, required=True)
@measuring(10_000)
def command(topics: tuple[str, ...], window: int, terms: Terms, place: Place) -> None:
    """Measure the rate of TOPICS, by simulation time and by the wall clock, until Ctrl-C.

    Simulation time is that of a message's header, without one that of /clock when it was sent. Messages that were lost
    on the way are known by their numbers: they are counted in the rate, and shown.
    """
    from deploy.live.measure import measure
    from deploy.live.meters import HzMeter

    raise SystemExit(measure(place, "hz", topics, lambda name: HzMeter(name, window), terms))
