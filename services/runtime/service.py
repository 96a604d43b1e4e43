"""The declaration of a service: its name, its loop, its rate and its parameters, without running any of it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from services.runtime.parameters.base import Parameters

Run = Callable[[Any], None]
"""The loop of a service; it gets the Context, with the service's parameters."""

Role = Literal["member", "observer", "free", "router"]
"""How a service stands to the simulation's time.

member: in lockstep, the simulation waits for it at each of its ticks.
observer: lockstep goes on as soon as it has its snapshot, and waits at its next tick if it is still busy with the last.
free: the simulation never waits for it.
router: the router, on which all others meet.
"""


@dataclass(frozen=True, kw_only=True)
class Service:
    """One kind of process.

    Args:
        name: also that of its node, unless the command line gives another.
        about: one line for its help.
        run: the loop, or its place as ``"package.module:function"`` to import it late.
        rate: of ``Context.ticks`` [Hz of simulation time]; None for a service that paces itself.
        parameters: what can be set, with its bounds and texts.
        parameter_set: the set that it follows, relative to its namespace or absolute; the node's own name when empty.
            Several services may follow one set. None: its parameters stay as it was started with.
        role: how it stands to the simulation's time.
    """

    name: str
    about: str
    run: Run | str
    rate: float | None = None
    parameters: type[Parameters] = Parameters
    parameter_set: str | None = ""
    role: Role = "member"

    @property
    def steps(self) -> bool:
        """Whether it takes part in lockstep, as a member or an observer."""
        return self.role in ("member", "observer") and self.rate is not None

    def entry(self) -> Run:
        """The loop itself, imported now if it was named by its place."""
        if callable(self.run):
            return self.run
        module, _, function = self.run.partition(":")
        entry: Run = getattr(importlib.import_module(module), function)
        return entry
