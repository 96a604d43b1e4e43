"""The logger service: records a run for the rerun viewer, into a file and live."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.base import Metres
from services.runtime.parameters.base import Parameters
from services.runtime.service import Service

_FIXED = {"live": False}
"""A recording under way keeps its file, its robots and its server."""


class LoggerParameters(Parameters, frozen=True, kw_only=True):
    """What to record, where to, and who may look on. Only ``window`` is live."""

    robots: Annotated[
        tuple[str, ...], Meta(description="Names of the robots, in the order of their colours.", extra=_FIXED)
    ] = ()
    models: Annotated[
        tuple[str, ...], Meta(description="Model of each robot; a single one applies to all.", extra=_FIXED)
    ] = ("burger",)
    states: Annotated[
        tuple[str, ...],
        Meta(description="Topic of each robot's joint controller state; empty for robots without one.", extra=_FIXED),
    ] = ()
    scans: Annotated[
        bool,
        Meta(description="Record laser scans, which the simulation then has to compute.", extra=_FIXED),
    ] = True
    file: Annotated[
        str, Meta(description="File to record to; run.rrd in the working directory if empty.", extra=_FIXED)
    ] = ""
    footer: Annotated[
        bool,
        Meta(
            description="End the file with a table of contents; costs 0.2 MiB of memory per minute and robot.",
            extra=_FIXED,
        ),
    ] = True
    serve: Annotated[bool, Meta(description="Serve the run to viewers on 127.0.0.1 while it lasts.", extra=_FIXED)] = (
        True
    )
    port: Annotated[int, Meta(ge=1024, le=65535, description="Port of the live view.", extra=_FIXED)] = 9876
    memory: Annotated[
        int,
        Meta(
            ge=16,
            le=65536,
            description="Memory for data kept for late viewers; the oldest is dropped.",
            extra={"unit": "MiB", "live": False},
        ),
    ] = 256
    view: Annotated[
        Literal["auto", "never", "always"],
        Meta(description="Open a viewer; 'auto' does so where there is a display.", extra=_FIXED),
    ] = "auto"
    window: Annotated[
        float, Meta(ge=0.02, le=10, description="Wall time between two batches.", extra={"unit": "s"})
    ] = 0.25
    extent: Annotated[
        tuple[Metres, Metres, Metres, Metres],
        Meta(
            description="Ground area of the initial view: x and y of one corner, then of the opposite one.",
            extra=_FIXED,
        ),
    ] = (-0.5, -4.5, 5.5, 4.5)


SERVICE = Service(
    name="logger",
    about="Records robots, trails, plots and logs for the rerun viewer, to a file and live.",
    run="services.logger.loop:run",
    rate=5,
    parameters=LoggerParameters,
    role="observer",
)
