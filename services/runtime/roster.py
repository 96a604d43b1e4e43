"""Waiting for nodes whose ticks may begin."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from services.runtime.graph import Entity, pattern
from services.runtime.log import Log
from services.runtime.network.transport import Transport

PATIENCE_S = 15.0
"""Wall time that a simulation which waits for nobody later waits for its fleet at the start."""


def missing(transport: Transport, roster: Iterable[str]) -> list[str]:
    """The nodes of the roster that do not tick yet."""
    found = (Entity.parse(key) for key in transport.tokens(pattern("step")))
    there = {entity.node for entity in found if entity is not None}
    return [node for node in roster if node not in there]


def gather(transport: Transport, roster: Iterable[str], idle: Callable[[], None], log: Log) -> None:
    """Block until the whole roster ticks, or PATIENCE_S have passed."""
    deadline = time.monotonic() + PATIENCE_S
    while absent := missing(transport, roster):
        if time.monotonic() > deadline:
            log.warn(f"{', '.join(absent)} not there after {PATIENCE_S:g} s: time begins without")
            return
        idle()
