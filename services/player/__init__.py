"""The player service: puts a bag back on the bus, on simulated time, at any rate or in lockstep."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime import Parameters, Service, param


class PlayerParameters(Parameters, frozen=True, kw_only=True):
    """What to play, and how."""

    bag: str = param("", text="an MCAP file, or a folder of them")
    topics: tuple[str, ...] = param((), text="names of the topics to play; all when none is given")
    exclude: str = param("", text="regular expression: do not play topics in whose names it is found")
    rate: float = param(1.0, 0, 1000, "", "simulated per wall-clock second; 0 is as fast as it can")
    loop: bool = param(False, text="begin again at the end, in a new epoch")
    start: float = param(0.0, 0, 1e9, "s", "begin so late in the bag")
    duration: float = param(0.0, 0, 1e9, "s", "play so long; 0: to the end")
    clock: float = param(0.0, 0, 200, "", "make /clock anew at this rate; 0: play the recorded one if there is one")
    wait: float = param(0.0, 0, 1e6, "s", "wait at most so long for subscribers; 0: not at all")
    members: tuple[str, ...] = param((), text="nodes that step with the bag, in lockstep")
    latency: Annotated[int, Meta(ge=0, le=1)] | None = param(
        None, text="in lockstep, ticks of its sender that a message takes; null: as the bag was recorded"
    )


SERVICE = Service(
    name="player",
    about="puts a bag back on the bus, on simulated time, at any rate or in lockstep",
    run="services.player.loop:run",
    parameters=PlayerParameters,
    role="free",
)
