"""The declaration of a service: what it reads, writes, serves and takes as parameters, without doing any of it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import msgspec

from messages.requests import Request
from messages.topics import Topic
from services.runtime.errors import BadInput

if TYPE_CHECKING:
    from services.runtime.context import Context


class Parameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The parameters of a service: a flat record of bool, int, float, str or tuples of them.

    Types carry bounds, unit and text: ``Annotated[float, Meta(ge=0, le=5, description=..., extra={"unit": "m"})]``.
    ``extra`` also marks with ``"live": False`` what a running service does not follow, and gives with ``"level": 2``
    the bit of ``Context.params_changed`` that tells of a change. ``"at_most": "fast"`` keeps a number below another
    one, and ``"excludes": ("a", "b")`` says what must be null or false while this is not; both are checked before a
    change counts.
    """


Run = Callable[["Context[Any]"], None]

STEP_NS = 5_000_000
"""The physics step, ns: 200 Hz. In lockstep every rate divides it."""


def period_of(rate: float, lockstep: bool) -> int:
    """The period [ns] of a rate [Hz]; in lockstep it must be a whole number of physics steps, else BadInput."""
    period = round(1e9 / rate)
    if lockstep and period % STEP_NS:
        raise BadInput(f"a rate of {rate:g} Hz is no whole number of physics steps of {STEP_NS / 1e6:g} ms")
    return period


@dataclass(frozen=True, kw_only=True)
class Service:
    """One kind of process. ``run`` is the loop, or its place as ``"package.module:function"`` to import it late.

    ``rate`` [Hz] of simulation time paces ``Context.ticks``; None for services that pace themselves.
    ``holds_lockstep`` tells whether the simulation may wait for it in lockstep. An ``observer`` only looks on: lockstep
    goes on as soon as it has its snapshot, and waits at its next tick if it is still busy with the last one.
    ``routes`` is the router's mark. ``parameter_set`` names the set of parameters that it follows, relative to its
    namespace or absolute; the node's own name when empty. Several services may follow one set.
    """

    name: str
    about: str
    run: Run | str
    reads: tuple[Topic[Any], ...] = ()
    writes: tuple[Topic[Any], ...] = ()
    serves: tuple[Request[Any, Any], ...] = ()
    rate: float | None = None
    parameters: type[Parameters] = field(default=Parameters)
    parameter_set: str = ""
    holds_lockstep: bool = True
    observer: bool = False
    routes: bool = False

    def entry(self) -> Run:
        """The loop itself, imported now if it was named by its place."""
        if callable(self.run):
            return self.run
        module, _, function = self.run.partition(":")
        entry: Run = getattr(importlib.import_module(module), function)
        return entry
