"""With which latency of lockstep the run of a bag took place: its simulation's own parameters tell."""

from __future__ import annotations

from messages.base import WrongPayload
from messages.parameters import ParameterValues
from services.bag.reading import Bag
from services.bag.typed import Typed, why_not

SETTINGS = "/sim/parameter_updates"
"""Where a simulation's parameters are told; a fleet's recording holds it, unless it was left out."""


def recorded_latency(bag: Bag) -> int | None:
    """The latency, 0 or 1; None when the bag does not tell. A run that was not in lockstep had none."""
    if not any(each.name == SETTINGS and not why_not(each) for each in bag.channels()):
        return None
    typed = Typed()
    for entry in bag.entries():
        if entry.channel.name != SETTINGS:
            continue
        try:
            message = typed.message(entry)
        except WrongPayload:
            continue
        if isinstance(message, ParameterValues):
            told = {each.name: each.value for each in message.values}
            return int(told.get("mode") == "lockstep" and told.get("latency") == 1)
    return None
