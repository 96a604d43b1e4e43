"""The logger service: records a run for the rerun viewer, into a file and live."""

from __future__ import annotations

from typing import Literal

from messages.base import Metres
from services.runtime import Parameters, Service, param

DEFAULT_EXTENT = (-0.5, -4.5, 5.5, 4.5)
"""Ground area [m] of the initial view in a world without bodies."""


class LoggerParameters(Parameters):
    """Parameters of the logger: content, file and live view. Only ``window`` is live."""

    robots: tuple[str, ...] = param((), text="Names of the robots, in the order of their colours.", live=False)
    namespaces: tuple[str, ...] = param(
        (), text="Namespace of each robot's topics, / for the root; the names themselves if empty.", live=False
    )
    frame_prefixes: tuple[str, ...] = param(
        (), text="Prefix of each robot's frames; its name and a slash if empty.", live=False
    )
    models: tuple[str, ...] = param(("burger",), text="Model of each robot; a single one applies to all.", live=False)
    states: tuple[str, ...] = param(
        (), text="Topic of each robot's joint controller state; empty for robots without one.", live=False
    )
    scans: bool = param(True, text="Record laser scans, which the simulation then has to compute.", live=False)
    file: str = param("", text="File to record to; run.rrd in the working directory if empty.", live=False)
    footer: bool = param(
        False,
        text="End the file with an index (rrd footer). The viewer works without; collecting it takes 0.2 MiB of memory "
        "per minute and robot.",
        live=False,
    )
    serve: bool = param(True, text="Serve the run to viewers on 127.0.0.1 while it lasts.", live=False)
    port: int = param(9876, 1024, 65535, "", "Port of the live view.", live=False)
    memory: int = param(
        256, 16, 65536, "MiB", "Memory for data kept for late viewers; the oldest is dropped.", live=False
    )
    view: Literal["auto", "never", "always"] = param(
        "auto", text="Open a viewer; 'auto' does so where there is a display.", live=False
    )
    window: float = param(0.25, 0.02, 10, "s", "Wall time between two batches.")
    extent: tuple[Metres, Metres, Metres, Metres] = param(
        DEFAULT_EXTENT,
        text="Ground area of the initial view: x and y of one corner, then of the opposite one. The default is widened "
        "to the bodies of the world.",
        live=False,
    )


SERVICE = Service(
    name="logger",
    about="Records robots, trails, plots and logs for the rerun viewer, to a file and live.",
    run="services.logger.loop:run",
    rate=5,
    parameters=LoggerParameters,
    role="observer",
)
