"""Whether a node reaches the others: a peer may be linked to the router and out of reach for everybody behind it.

Peers talk straight to each other and never through the router, and they listen for this machine only. So a peer on
another machine, or in another network namespace, that joins their router hears nobody, and nobody hears it.
"""

from __future__ import annotations

import time
from collections.abc import Set

from messages.base import FAULTS, decoder
from services.runtime.graph import Entity, pattern
from services.runtime.log import Log
from services.runtime.network.transport import Pending, Transport, Watch
from services.runtime.register import KEY, WITHIN_S, Present

FIRST_S = 2.0
"""Wall time from joining to the first look: by then the links are up."""
AGAIN_S = 1.0
"""Wall time to the next look after one that found a node cut off: two must find it."""
LATER_S = 10.0
"""Wall time between looks that find all well."""
_SHOWN = 5
"""Nodes that are named at most."""

_read = decoder(Present)


def unreached(known: Set[str], seen: Set[str]) -> list[str]:
    """The nodes, by name, of which a node that is cut off sees nothing; empty for one that is not cut off.

    Args:
        known: tokens of nodes that the router knows, without the node's own and the router's.
        seen: tokens of nodes that the node itself sees.

    It is cut off when it sees less than half of them. The others miss it alone, and say nothing.
    """
    missed = known - seen
    if 2 * len(missed) <= len(known):
        return []
    found = (Entity.parse(key) for key in missed)
    return sorted(each.node for each in found if each is not None)


class Reach:
    """Looks now and then, and logs when the node is cut off, and when it is no longer."""

    def __init__(self, transport: Transport, log: Log) -> None:
        self._transport, self._log = transport, log
        self._due = time.monotonic() + FIRST_S
        self._watch: Watch | None = None
        self._seen: set[str] = set()
        self._asked: Pending | None = None
        self._suspected = self._told = False

    def turn(self) -> None:
        """Look if it is time; from the loop, without waiting."""
        if self._asked is None and time.monotonic() < self._due:
            return
        self._watch = self._watch or self._transport.watch(pattern("node"))
        while (event := self._watch.take()) is not None:
            (self._seen.add if event.alive else self._seen.discard)(event.key)
        if self._asked is None:
            self._asked = self._transport.ask(KEY, b"", WITHIN_S)
        elif (replies := self._asked.take()) is not None:
            self._asked, self._due = None, time.monotonic() + LATER_S
            for reply in replies:
                if reply.ok:
                    self._judge(reply.payload)

    def _judge(self, answer: bytes) -> None:
        try:
            listed = frozenset(_read(answer).nodes)
        except FAULTS:
            return
        found = {key: Entity.parse(key) for key in listed}
        known = {
            key
            for key, each in found.items()
            if each is not None and each.name != "router" and each.session != self._transport.session
        }
        missed = unreached(known, self._seen)
        if missed and not self._told:
            self._due = time.monotonic() + AGAIN_S
            if self._suspected:
                self._told = True
                self._log.error(_told(missed, len(known)))
        elif self._told and not missed:
            self._told = False
            self._log.info(f"this node now reaches the {len(known)} nodes that the router knows")
        self._suspected = bool(missed)


def _told(missed: list[str], known: int) -> str:
    named = ", ".join(missed[:_SHOWN]) + (f" and {len(missed) - _SHOWN} more" if len(missed) > _SHOWN else "")
    return (
        f"this node is cut off from {len(missed)} of the {known} nodes that the router knows ({named}): in topology "
        "direct they talk to each other without the router, on links that end at their own machine or network "
        "namespace. Start this node with --topology star, which goes through the router"
    )
