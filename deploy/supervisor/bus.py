"""The seam between the supervisor and the network: heartbeats in, the fleet's state out, orders in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, Protocol

from messages.elea import FleetState, Health

Verb = Literal["start", "stop", "restart"]

CarryOut = Callable[[Verb, str], str]
"""Takes an order for a process by name and says what will be done; raises BadInput to refuse."""


class Bus(Protocol):
    """What the supervisor needs of the network. No verb blocks."""

    def beats(self) -> Sequence[Health]:
        """The heartbeats that have come since the last call."""
        ...

    @property
    def flooded(self) -> bool:
        """Whether so much comes where heartbeats come that true ones are overwritten before they are read."""
        ...

    def carries(self) -> bool:
        """Whether the router answers: asked again and again, it tells what the last seconds have shown."""
        ...

    def publish(self, state: FleetState) -> None:
        """Tell the state of the fleet; whoever comes later gets the last one."""
        ...

    def answer(self, carry_out: CarryOut) -> None:
        """Answer the orders that wait."""
        ...
