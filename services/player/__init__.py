"""The player service: puts a bag back on the bus, on simulated time, at any rate or in lockstep."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


class PlayerParameters(Parameters, frozen=True, kw_only=True):
    """What to play, and how."""

    bag: Annotated[str, Meta(description="MCAP file to play, or a folder of them.")] = ""
    topics: Annotated[tuple[str, ...], Meta(description="Topics to play; all if none are given.")] = ()
    exclude: Annotated[str, Meta(description="Do not play topics whose names match this regular expression.")] = ""
    rate: Annotated[
        float,
        Meta(ge=0, le=1000, description="Simulated seconds per wall-clock second; 0 plays as fast as possible."),
    ] = 1.0
    loop: Annotated[bool, Meta(description="Start again at the end, in a new epoch.")] = False
    start: Annotated[
        float, Meta(ge=0, le=1e9, description="Offset in the bag at which to start.", extra={"unit": "s"})
    ] = 0.0
    duration: Annotated[
        float, Meta(ge=0, le=1e9, description="How much of the bag to play; 0 plays to the end.", extra={"unit": "s"})
    ] = 0.0
    clock: Annotated[
        float, Meta(ge=0, le=200, description="Publish /clock at this rate; 0 plays the recorded one, if any.")
    ] = 0.0
    wait: Annotated[
        float,
        Meta(ge=0, le=1e6, description="Longest wait for subscribers; 0 does not wait.", extra={"unit": "s"}),
    ] = 0.0
    members: Annotated[tuple[str, ...], Meta(description="Nodes that step with the bag, in lockstep.")] = ()
    latency: Annotated[
        Annotated[int, Meta(ge=0, le=1)] | None,
        Meta(description="Delay of a message in lockstep, in ticks of its sender; as recorded if not set."),
    ] = None


SERVICE = Service(
    name="player",
    about="Plays a bag in simulation time, at any rate or in lockstep.",
    run="services.player.loop:run",
    parameters=PlayerParameters,
    role="free",
)
