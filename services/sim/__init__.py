"""The simulation: physics, sensors and the base drivers of all robots, and simulation time itself."""

from typing import Annotated, Literal

from msgspec import Meta

from services.runtime.discovery import START_PATIENCE_S
from services.runtime.parameters.base import Parameters
from services.runtime.service import Service
from services.sim.parameters import RobotEntry

_FIXED = {"live": False}


class SimParameters(Parameters, frozen=True, kw_only=True):
    """The world, its robots and how time runs; ``factor`` alone is live."""

    world: Annotated[str, Meta(description="World, from models/worlds.", extra=_FIXED)] = "empty"
    robots: Annotated[tuple[RobotEntry, ...], Meta(description="Robots to spawn at the start.")] = ()
    mode: Annotated[
        Literal["lockstep", "real"],
        Meta(description="How time runs: in lockstep with the members, or by the wall clock.", extra=_FIXED),
    ] = "real"
    factor: Annotated[
        float, Meta(gt=0, le=1000, description="Simulated seconds per wall-clock second, in mode 'real'.")
    ] = 1.0
    latency: Annotated[
        int,
        Meta(
            ge=0,
            le=1,
            description="Delay of a command in lockstep, in ticks of its sender; 1 overlaps control and physics.",
            extra=_FIXED,
        ),
    ] = 0
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="Random seed of the sensor noise.", extra=_FIXED)] = 0
    members: Annotated[
        tuple[str, ...],
        Meta(description="Nodes to wait for at each tick in lockstep, and at the start in mode 'real'.", extra=_FIXED),
    ] = ()
    stops_file: Annotated[
        str,
        Meta(description="File that keeps emergency stops across restarts; in memory only if empty.", extra=_FIXED),
    ] = ""
    awaits: Annotated[
        tuple[str, ...], Meta(description="Further nodes to wait for before time starts.", extra=_FIXED)
    ] = ()
    requires: Annotated[
        tuple[str, ...],
        Meta(description="The awaited nodes without which time does not start at all.", extra=_FIXED),
    ] = ()
    start_timeout: Annotated[
        float,
        Meta(
            gt=0,
            le=3600,
            description="Longest wait for the next node to become ready; then start without the rest, or fail.",
            extra={"unit": "s", "live": False},
        ),
    ] = START_PATIENCE_S


SERVICE = Service(
    name="sim",
    about="Simulates physics, sensors and base drivers, and publishes simulation time.",
    run="services.sim.loop:run",
    parameters=SimParameters,
    role="free",
)
