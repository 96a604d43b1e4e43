"""The parameter service: checks, applies, saves and publishes the parameters of all services."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from messages.parameters import Value
from services.runtime import Parameters, Service, param

FILE_TEXT = "SQLite file for saved values; empty or :memory: keeps them for this run only."


class Scheduled(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A change of a parameter set at a simulation time [s], for this run only."""

    at: Annotated[float, Meta(ge=0, le=1e7, extra={"unit": "s"})]
    set: str
    values: dict[str, Value]


class ParamsParameters(Parameters):
    """Parameters of the parameter service: its file, and scheduled changes."""

    file: str = param("", text=FILE_TEXT, max_length=4096)
    schedule: tuple[Scheduled, ...] = param(
        (), text="Changes {at, set, values} to make at given simulation times; not saved."
    )
    schedule_file: str = param(
        "",
        text="JSON file that records which scheduled changes were made, so that a restart does not repeat them; empty "
        "for none.",
        max_length=4096,
    )
    rosparam_file: str = param(
        "",
        text="JSON file with the tree of ROS 1's parameters (rosparam) at the start; empty for an empty tree.",
        max_length=4096,
    )


SERVICE = Service(
    name="params",
    about="Parameter server: checks, stores and publishes the parameters of all services.",
    run="services.params.loop:run",
    rate=10,
    alone="all others need it",
    parameters=ParamsParameters,
    parameter_set=None,
)
