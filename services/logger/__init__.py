"""The logger service: records a run for the rerun viewer, into a file and live."""

from __future__ import annotations

from typing import Literal

from messages.base import Metres
from services.runtime import Parameters, Service, param


class LoggerParameters(Parameters, frozen=True, kw_only=True):
    """What to record, where to, and who may look on. Only ``window`` is live."""

    robots: tuple[str, ...] = param((), text="names of the robots, in the order of their colours", live=False)
    models: tuple[str, ...] = param(
        ("burger",), text="model of each robot; a single one stands for all of them", live=False
    )
    states: tuple[str, ...] = param(
        (), text="where each robot's joint controller tells its state; empty for those without", live=False
    )
    scans: bool = param(
        True, text="record what the robots' lasers see, which the simulation then has to compute", live=False
    )
    file: str = param("", text="the recording; empty means run.rrd in the working directory", live=False)
    footer: bool = param(
        True,
        text="end the file with a table of contents; off saves about 0.2 MiB of memory a minute and robot",
        live=False,
    )
    serve: bool = param(True, text="serve the run to viewers on 127.0.0.1 while it lasts", live=False)
    port: int = param(9876, 1024, 65535, "", "port of the live view", live=False)
    memory: int = param(256, 16, 65536, "MiB", "kept for viewers that come late, oldest dropped", live=False)
    view: Literal["auto", "never", "always"] = param(
        "auto", text="open a viewer: auto does so where there is a display", live=False
    )
    window: float = param(0.25, 0.02, 10, "s", "wall time between two batches")
    extent: tuple[Metres, Metres, Metres, Metres] = param(
        (-0.5, -4.5, 5.5, 4.5),
        text="ground that the first picture shows: x and y of a corner, then of the opposite one",
        live=False,
    )


SERVICE = Service(
    name="logger",
    about="records robots, trails, plots and log for the rerun viewer, into a file and live",
    run="services.logger.loop:run",
    rate=5,
    parameters=LoggerParameters,
    role="observer",
)
