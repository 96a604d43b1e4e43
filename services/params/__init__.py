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

    file: str = param("", text="SQLite file of what was set; empty or :memory: keeps it for this run", max_length=4096)
    schedule: tuple[Scheduled, ...] = param((), text="changes {at, set, values} at times of the simulation, not saved")


SERVICE = Service(
    name="params",
    about="Keeps every service's parameters: checks, applies, saves and publishes what is set.",
    run="services.params.loop:run",
    rate=10,
    parameters=ParamsParameters,
    parameter_set=None,
)
