"""The panel service: a web page on the loopback to watch, drive, tune and stop a fleet."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from messages.topics import CLOCK, FLEET_STATE, HEALTH, ROSOUT
from services.runtime.parameters.base import Parameters
from services.runtime.service import Service

_FIXED = {"live": False}
"""Marks what a running panel does not change."""


def _number(low: float, high: float, unit: str, text: str) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit})


class PanelParameters(Parameters, frozen=True, kw_only=True):
    """Where the page is, and what those who look at it may do."""

    port: Annotated[
        int,
        Meta(
            ge=0,
            le=65535,
            description="port on 127.0.0.1; when it is taken, the next free one; 0 takes any",
            extra=_FIXED,
        ),
    ] = 8600
    address: Annotated[
        str,
        Meta(max_length=4096, description="file for the page's address and token, readable by its owner", extra=_FIXED),
    ] = ""
    deadline: Annotated[float, _number(0.1, 30, "s", "wall time after which a request counts as unanswered")] = 5.0
    silence: Annotated[
        float, _number(0.1, 2, "s", "a page that drives and says nothing for so long has let the robot go")
    ] = 0.3
    give_way: Annotated[
        float, _number(0.3, 60, "s", "simulation time for which zero is held after a drive; then others may drive")
    ] = 3.0
    max_linear: Annotated[float, _number(0.05, 10, "m/s", "no page drives a robot faster")] = 1.0
    max_angular: Annotated[float, _number(0.1, 20, "rad/s", "no page turns a robot faster")] = 3.0
    pages: Annotated[int, Meta(ge=1, le=64, description="pages that may be open at once", extra=_FIXED)] = 16


SERVICE = Service(
    name="panel",
    about="a web page on the loopback to watch, drive, tune and stop a fleet",
    run="services.panel.loop:run",
    reads=(CLOCK, HEALTH, ROSOUT, FLEET_STATE),
    parameters=PanelParameters,
    holds_lockstep=False,
    observer=True,
)
