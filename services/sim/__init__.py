"""The simulation: physics, sensors and the base drivers of all robots, and simulation time itself."""

from typing import Annotated, Literal

from msgspec import Meta

from services.runtime import Parameters, Service, param
from services.runtime.discovery import START_PATIENCE_S
from services.sim.parameters import RobotEntry

_FIXED = {"live": False}


class SimParameters(Parameters, frozen=True, kw_only=True):
    """The world, its robots and the time mode; only ``factor`` is live."""

    world: str = param("empty", text="World: a name from models/worlds, or the path of a world's file.", live=False)
    robots: tuple[RobotEntry, ...] = param((), text="Robots to spawn at the start.")
    engine: Literal["", "pybullet", "mujoco"] = param(
        "", text="Physics engine; if empty, PyBullet where it is installed, else MuJoCo.", live=False
    )
    mode: Literal["lockstep", "real"] = param(
        "real", text="How time runs: in lockstep with the members, or by the wall clock.", live=False
    )
    factor: Annotated[
        float, Meta(gt=0, le=1000, description="Simulated seconds per wall-clock second, in mode 'real'.")
    ] = 1.0
    latency: int = param(
        0,
        0,
        1,
        "",
        "Delay of commands in lockstep, in ticks of the sender; with 1, control and physics run in parallel.",
        live=False,
    )
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="Random seed of the sensor noise.", extra=_FIXED)] = 0
    members: tuple[str, ...] = param(
        (), text="Nodes to wait for at each tick in lockstep, and at the start in mode 'real'.", live=False
    )
    stops_file: str = param(
        "", text="File that keeps emergency stops across restarts; in memory only if empty.", live=False
    )
    model_folders: tuple[str, ...] = param(
        (),
        text="Folders from which spawn requests may load robots; relative paths start in the first.",
        live=False,
    )
    awaits: tuple[str, ...] = param((), text="Nodes to wait for before time starts, besides the members.", live=False)
    requires: tuple[str, ...] = param(
        (), text="Those of the awaited nodes without which time never starts.", live=False
    )
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
