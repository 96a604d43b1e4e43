"""``elea topic delay``: how late a topic comes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from deploy.commands.topic.shared import measuring, topic_argument
from deploy.place import Place

if TYPE_CHECKING:
    from deploy.live.measure import Terms


@click.command("delay")
@topic_argument
@measuring(10_000)
def command(topic: str, window: int, terms: Terms, place: Place) -> None:
    """Measure how old the messages of TOPIC are when they arrive, until Ctrl-C.

    Once by simulation time, from the stamp in the header to the last /clock, which comes every 20 ms; and once by the
    wall clock, from the sending, whose time every sample bears: exact on one machine.
    """
    from deploy.live.measure import measure
    from deploy.live.meters import DelayMeter

    raise SystemExit(measure(place, "delay", (topic,), lambda name: DelayMeter(name, window), terms))
