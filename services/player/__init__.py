"""The player service: plays a bag back on simulated time, at any rate or in lockstep."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime import Parameters, Service, param


class PlayerParameters(Parameters):
    """Parameters of the player."""

    bag: str = param("", text="MCAP file to play, or a folder of them.")
    topics: tuple[str, ...] = param((), text="Topics to play; all if none are given.")
    exclude: str = param("", text="Do not play topics whose names match this regular expression.")
    rate: float = param(1.0, 0, 1000, "", "Simulated seconds per wall-clock second; 0 plays as fast as possible.")
    loop: bool = param(False, text="Start again at the end, in a new epoch.")
    start: float = param(0.0, 0, 1e9, "s", "Offset in the bag at which to start.")
    duration: float = param(0.0, 0, 1e9, "s", "Length of the part to play; 0 plays to the end.")
    clock: float = param(0.0, 0, 200, "", "Publish /clock at this rate; 0 plays the recorded one, if any.")
    wait: float = param(0.0, 0, 1e6, "s", "Longest wait for subscribers; 0 does not wait.")
    members: tuple[str, ...] = param((), text="Nodes that step with the bag, in lockstep.")
    latency: Annotated[int, Meta(ge=0, le=1)] | None = param(
        None, text="Delay of a message in lockstep, in ticks of its sender; as recorded if not set."
    )


SERVICE = Service(
    name="player",
    about="Plays a bag in simulation time, at any rate or in lockstep.",
    run="services.player.loop:run",
    parameters=PlayerParameters,
    role="free",
)
