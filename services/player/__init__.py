"""The player service: puts a bag back on the bus, on simulated time, at any rate or in lockstep."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


class PlayerParameters(Parameters, frozen=True, kw_only=True):
    """What to play, and how."""

    bag: Annotated[str, Meta(description="an MCAP file, or a folder of them")] = ""
    topics: Annotated[tuple[str, ...], Meta(description="names of the topics to play; all when none is given")] = ()
    exclude: Annotated[str, Meta(description="regular expression: do not play topics in whose names it is found")] = ""
    rate: Annotated[
        float,
        Meta(ge=0, le=1000, description="simulated per wall-clock second; 0 is as fast as it can"),
    ] = 1.0
    loop: Annotated[bool, Meta(description="begin again at the end, in a new epoch")] = False
    start: Annotated[float, Meta(ge=0, le=1e9, description="begin so late in the bag", extra={"unit": "s"})] = 0.0
    duration: Annotated[float, Meta(ge=0, le=1e9, description="play so long; 0: to the end", extra={"unit": "s"})] = 0.0
    clock: Annotated[
        float, Meta(ge=0, le=200, description="make /clock anew at this rate; 0: play the recorded one if there is one")
    ] = 0.0
    wait: Annotated[
        float,
        Meta(ge=0, le=1e6, description="wait at most so long for subscribers; 0: not at all", extra={"unit": "s"}),
    ] = 0.0
    members: Annotated[tuple[str, ...], Meta(description="nodes that step with the bag, in lockstep")] = ()
    latency: Annotated[
        Annotated[int, Meta(ge=0, le=1)] | None,
        Meta(description="in lockstep, ticks of its sender that a message takes; null: as the bag was recorded"),
    ] = None


SERVICE = Service(
    name="player",
    about="puts a bag back on the bus, on simulated time, at any rate or in lockstep",
    run="services.player.loop:run",
    parameters=PlayerParameters,
    role="free",
)
