"""What the simulation knows of one member of its lockstep."""

from __future__ import annotations

from dataclasses import dataclass, field

from services.runtime.lockstep.marks import Numbers
from services.runtime.lockstep.protocol import Done
from services.runtime.network.transport import Outlet


@dataclass
class Member:
    """One member: ``marks`` and ``known`` are what it has not been told yet.

    ``told`` is the generation of members it was told last, ``answer`` its Done for the step that is pending.
    """

    node: str
    id: bytes
    period_ns: int
    outlet: Outlet
    greeting: bytes = b""
    greeted_at: float = 0.0
    active: bool = False
    told: int = -1
    answer: Done | None = None
    marks: Numbers = field(default_factory=dict)
    known: Numbers = field(default_factory=dict)
