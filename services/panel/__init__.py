"""The panel service: a web page on the loopback to watch, drive, tune and stop a fleet."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters, param
from services.runtime.service import Service

_FIXED = {"live": False}
"""Marks what a running panel does not change."""


class PanelParameters(Parameters, frozen=True, kw_only=True):
    """Where the page is, and what those who look at it may do."""

    port: Annotated[
        int,
        Meta(
            ge=0,
            le=65535,
            description="Port on 127.0.0.1; the next free one if it is taken, any free one if 0.",
            extra=_FIXED,
        ),
    ] = 8600
    address: Annotated[
        str,
        Meta(
            max_length=4096,
            description="File for the page's address and token, readable only by its owner.",
            extra=_FIXED,
        ),
    ] = ""
    deadline: float = param(5.0, 0.1, 30, "s", "Wall time after which a request counts as unanswered.")
    silence: float = param(0.3, 0.1, 2, "s", "Release the robot when the driving page has sent nothing for this long.")
    give_way: float = param(
        3.0, 0.3, 60, "s", "Simulation time for which zero is sent after a drive, before others may drive."
    )
    max_linear: float = param(1.0, 0.05, 10, "m/s", "Maximum speed that a page can command.")
    max_angular: float = param(3.0, 0.1, 20, "rad/s", "Maximum turn rate that a page can command.")
    pages: Annotated[int, Meta(ge=1, le=64, description="Maximum number of pages open at once.", extra=_FIXED)] = 16


SERVICE = Service(
    name="panel",
    about="Serves a web page on the loopback to watch, drive, tune and stop a fleet.",
    run="services.panel.loop:run",
    parameters=PanelParameters,
    role="observer",
)
