"""The declaration of a service: what it reads, writes, serves and takes as parameters, without doing any of it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import msgspec

from messages.requests import Request
from messages.topics import Topic

if TYPE_CHECKING:
    from services.runtime.context import Context


class Parameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The parameters of a service: a flat record of bool, int, float, str or tuples of them.

    Types carry bounds, unit and text: ``Annotated[float, Meta(ge=0, le=5, description=..., extra={"unit": "m"})]``.
    """


Run = Callable[["Context[Any]"], None]


@dataclass(frozen=True, kw_only=True)
class Service:
    """One kind of process. ``run`` is the loop, or its place as ``"package.module:function"`` to import it late.

    ``rate`` [Hz] of simulation time paces ``Context.ticks``; None for services that pace themselves.
    ``holds_lockstep`` tells whether the simulation may wait for it in lockstep; ``routes`` is the router's mark.
    """

    name: str
    about: str
    run: Run | str
    reads: tuple[Topic[Any], ...] = ()
    writes: tuple[Topic[Any], ...] = ()
    serves: tuple[Request[Any, Any], ...] = ()
    rate: float | None = None
    parameters: type[Parameters] = field(default=Parameters)
    holds_lockstep: bool = True
    routes: bool = False

    def entry(self) -> Run:
        """The loop itself, imported now if it was named by its place."""
        if callable(self.run):
            return self.run
        module, _, function = self.run.partition(":")
        entry: Run = getattr(importlib.import_module(module), function)
        return entry
