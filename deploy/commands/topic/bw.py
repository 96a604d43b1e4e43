"""``elea topic bw``: how many bytes a topic takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from deploy.commands.completion import TOPIC
from deploy.commands.topic.shared import measuring
from deploy.place import Place

if TYPE_CHECKING:
    from deploy.live.measure import Terms


@click.command("bw")
@click.argument("topics", type=TOPIC, nargs=-1, required=True)
@measuring(100)
def command(topics: tuple[str, ...], window: int, terms: Terms, place: Place) -> None:
    """Measure the bytes of payload that each of TOPICS takes each second, until Ctrl-C.

    Each sample has 33 bytes more beside its payload, and what the network adds.
    """
    from deploy.live.measure import measure
    from deploy.live.meters import BwMeter

    raise SystemExit(measure(place, "bw", topics, lambda name: BwMeter(name, window), terms))
