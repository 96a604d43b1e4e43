"""A node that subscribes to a parameter set, with its log and its rejected updates."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from msgspec import Meta

from messages.topics import UPDATES
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import memory_node

SET = "/tb3_0/pilot"


class Gains(Parameters):
    p: Annotated[float, Meta(ge=0, le=5)] = 1.0
    d: Annotated[float, Meta(ge=0, le=5, extra={"level": 4})] = 0.1
    law: Annotated[Literal["pd", "pid"], Meta(extra={"level": 2})] = "pd"
    points: tuple[tuple[float, float], ...] = ()
    file: Annotated[str, Meta(extra={"live": False})] = "a"


@contextmanager
def parameter_node(bus: MemoryBus, **options: Any) -> Iterator[tuple[Node, ParameterSubscription[Gains]]]:
    with MemoryTransport(bus) as transport, memory_node(bus, "pilot", "/tb3_0", transport) as made:
        yield made, ParameterSubscription(made, SET, options.pop("params", Gains()), **options)


def spin_once(made: Node, followed: ParameterSubscription[Gains]) -> int:
    """Update once, as at a tick; return the levels of the changes."""
    made.spin_once()
    followed.update()
    return followed.refresh()


def log_of(made: Node) -> str:
    assert made.log._out is not None
    return made.log._out.getvalue()  # type: ignore[attr-defined]


def rejected_updates(made: Node) -> int:
    return sum(each.refused for each in made.subscribers if each.topic is UPDATES)


def check_damping(gains: Gains) -> None:
    """Check a relation between parameters; raises BadInput if d exceeds p."""
    if gains.d > gains.p:
        raise BadInput(f"d = {gains.d:g} above p = {gains.p:g} rings")
