"""The simulation: physics, sensors and the base drivers of all robots, and simulation time itself."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from services.runtime import Parameters, Service, param
from services.runtime.discovery import START_PATIENCE_S
from services.sim.parameters import BaseParameters as BaseParameters
from services.sim.parameters import JointParameters as JointParameters

Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4, extra={"unit": "m"})]


_FIXED = {"live": False}


class RobotEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A robot that is there from the start.

    ``parameters`` are those of a model with wheels, ``joint_parameters`` those of one without. ``joints`` are positions
    to start from, rad or m, 0 where none is stated.
    """

    name: str
    model: str
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    yaw: float = 0.0
    namespace: str = ""
    parameters: BaseParameters = BaseParameters()
    joint_parameters: JointParameters = JointParameters()
    joints: dict[str, float] = {}


class SimParameters(Parameters, frozen=True, kw_only=True):
    """The world, its robots and how time runs; ``factor`` alone is live."""

    world: str = param("empty", text="world of models/worlds", live=False)
    robots: tuple[RobotEntry, ...] = param((), text="robots that are there from the start")
    mode: Literal["lockstep", "real"] = param("real", text="how time runs", live=False)
    factor: Annotated[float, Meta(gt=0, le=1000, description="simulated per wall-clock second, in real time")] = 1.0
    latency: int = param(
        0, 0, 1, "", "ticks of its sender that a command takes in lockstep; 1 overlaps control and physics", live=False
    )
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="seed of the sensors' noise", extra=_FIXED)] = 0
    members: tuple[str, ...] = param(
        (), text="nodes that lockstep waits for at each tick, and real time at the start", live=False
    )
    stops_file: str = param(
        "", text="file that keeps emergency stops through a restart; none: in memory alone", live=False
    )
    awaits: tuple[str, ...] = param((), text="further nodes that must be ready before time begins", live=False)
    requires: tuple[str, ...] = param(
        (), text="those of all these nodes without which time does not begin at all", live=False
    )
    start_timeout: Annotated[
        float,
        Meta(
            gt=0,
            le=3600,
            description="wall time without a further node becoming ready after which time begins without, or fails",
            extra={"unit": "s", "live": False},
        ),
    ] = START_PATIENCE_S


SERVICE = Service(
    name="sim",
    about="Physics, sensors, base drivers and simulation time.",
    run="services.sim.loop:run",
    parameters=SimParameters,
    role="free",
)
