"""Waiting for the nodes of a fleet to be ready."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable

from services.runtime.graph import Entity, pattern
from services.runtime.network.transport import Transport

PATIENCE_S = 60.0
"""Wall time to wait for further nodes while none becomes ready. A busy machine starts a fleet slowly, but on and on."""


def missing(transport: Transport, roster: Iterable[str]) -> list[str]:
    """The nodes of the roster that are not ready: they neither tick nor say that they are at work."""
    keys = [*transport.tokens(pattern("step")), *transport.tokens(pattern("ready"))]
    ready = {entity.node for entity in map(Entity.parse, keys) if entity is not None}
    return [node for node in roster if node not in ready]


def gather(
    transport: Transport,
    roster: Iterable[str],
    idle: Callable[[], None],
    patience_s: float = PATIENCE_S,
    tell: Callable[[list[str], float], None] | None = None,
    ended: Callable[[], Collection[str]] = tuple,
) -> list[str]:
    """Block until every node of the roster is ready.

    Args:
        transport: where the nodes show that they are ready.
        roster: names of nodes.
        idle: called between two looks; it blocks for a moment.
        patience_s: wall time [s] without another node becoming ready after which the wait ends.
        tell: called at each look with the nodes that are waited for and the wall time [s] waited.
        ended: nodes that have ended for good: they are not waited for.

    Returns:
        The nodes that are not ready; empty when all are.
    """
    wanted = list(roster)
    started = renewed = time.monotonic()
    fewest = len(wanted) + 1
    while absent := missing(transport, wanted):
        now = time.monotonic()
        if len(absent) < fewest:
            fewest, renewed = len(absent), now
        gone = set(ended())
        awaited = [node for node in absent if node not in gone]
        if not awaited or now - renewed > patience_s:
            return absent
        if tell is not None:
            tell(awaited, now - started)
        idle()
    return []
