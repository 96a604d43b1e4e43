"""The declaration of a service: what it reads, writes, serves and takes as parameters, without doing any of it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from messages.requests import Request
from messages.topics import Topic
from services.runtime.context import Context
from services.runtime.parameters.base import Parameters

Run = Callable[[Context[Any]], None]


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
