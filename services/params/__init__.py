"""The parameter service: checks, applies, saves and publishes the parameters of all services."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from messages.parameters import Value
from messages.requests import PARAMS_REQUESTS
from messages.topics import DESCRIPTIONS, SCHEDULE, UPDATES
from services.runtime.service import Parameters, Service

FILE_TEXT = "SQLite file of the saved values; empty or :memory: keeps them for this run only."


class Scheduled(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A change of a set at a simulation time, for this run only."""

    at: Annotated[float, Meta(ge=0, le=1e7, extra={"unit": "s"})]
    set: str
    values: dict[str, Value]


class ParamsParameters(Parameters, frozen=True, kw_only=True):
    """Where values are saved, and which changes are made at given times."""

    file: Annotated[str, Meta(max_length=4096, description=FILE_TEXT)] = ""
    schedule: Annotated[
        tuple[Scheduled, ...],
        Meta(description="Changes {at, set, values} to make at simulation times, for this run only."),
    ] = ()
    schedule_file: Annotated[
        str,
        Meta(
            max_length=4096,
            description="JSON file that records which scheduled changes were made, so that a restart does not repeat "
            "them; empty for none.",
        ),
    ] = ""


SERVICE = Service(
    name="params",
    about="Keeps every service's parameters: checks, applies, saves and publishes what is set.",
    run="services.params.loop:run",
    writes=(DESCRIPTIONS, UPDATES, SCHEDULE),
    serves=PARAMS_REQUESTS,
    rate=10,
    parameters=ParamsParameters,
)
