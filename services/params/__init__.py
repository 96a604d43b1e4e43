"""The parameter service: the one authority on every service's parameters, typed, bounded, kept and published."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from messages.parameters import Value
from services.runtime import Parameters, Service, param


class Scheduled(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A change at a time of the run, for this run alone."""

    at: Annotated[float, Meta(ge=0, le=1e7, extra={"unit": "s"})]
    set: str
    values: dict[str, Value]


class ParamsParameters(Parameters, frozen=True, kw_only=True):
    """Where values are kept, and what changes by itself on the way."""

    file: str = param(
        "", text="SQLite file for saved values; empty or :memory: keeps them for this run only.", max_length=4096
    )
    schedule: tuple[Scheduled, ...] = param(
        (), text="Changes {at, set, values} to make at given simulation times; not saved."
    )


SERVICE = Service(
    name="params",
    about="Parameter server: checks, stores and publishes the parameters of all services.",
    run="services.params.loop:run",
    rate=10,
    parameters=ParamsParameters,
    parameter_set=None,
)
