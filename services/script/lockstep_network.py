"""A script's view of the network in lockstep: the same at the same tick of every run.

Liveliness tokens arrive at any time. The scripts of a fleet therefore announce what they publish, subscribe to and
serve on a topic, which lockstep orders like all others; for other nodes the tokens count, as of the start of the tick.
"""

from __future__ import annotations

from typing import Any

import msgspec

from messages.base import DECODE_ERRORS, encode, raw_decoder
from messages.names import key as key_of
from messages.records import unknown_record
from messages.topics import Quality, Topic
from services.runtime.graph import Entity
from services.runtime.transport.api import Transport
from services.runtime.transport.wire import publisher_id
from services.script.api import GraphEntry, Origin
from services.script.network import Network

ENDPOINTS: Topic[Any] = Topic(
    "/_scripts",
    unknown_record("elea_msgs/ScriptEnds"),
    0,
    Quality.LATCHED,
    "publications, subscriptions and services of a script",
    1 << 20,
)
SCRIPT = "script"
"""The kind of node in a script's token."""
ANNOUNCING = (SCRIPT, "turtlesim")
"""The kinds of nodes that announce their endpoints; their tokens do not count."""


class Endpoint(msgspec.Struct, frozen=True):
    """A publication, subscription or service of a script."""

    kind: str
    name: str
    type: str
    latched: bool = False


class ScriptEnds(msgspec.Struct, frozen=True):
    """All publications, subscriptions and services of a script."""

    node: str
    session: str
    ends: tuple[Endpoint, ...] = ()


_decode = raw_decoder(ScriptEnds)


class LockstepNetwork(Network):
    """The network as of the start of the tick."""

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._scripts: dict[str, ScriptEnds] = {}
        self._frozen: list[Entity] = []
        self._announced: set[str] = set()
        self._seen = -1
        self.begun = False
        """Whether there was a tick; before the first, tokens count as they arrive."""

    def receive(self, payload: bytes) -> bool:
        """Process another script's announcement; return whether it is valid."""
        try:
            script = _decode(payload)
            for each in script.ends:
                if each.kind == "pub":
                    publisher = publisher_id(script.node, script.session, key_of(each.name))
                    self._origins[publisher] = Origin(script.node, each.latched)
        except DECODE_ERRORS:
            return False
        if script.ends:
            self._scripts[script.session] = script
        else:
            self._scripts.pop(script.session, None)
        return True

    def freeze(self) -> None:
        """Use the tokens that have arrived so far, until the next call."""
        if self._seen == self.version:
            return
        self._seen = self.version
        with self._lock:
            entities = list(self._entities.values())
        scripts = {each.session for each in entities if each.kind == "node" and each.name in ANNOUNCING}
        # An announcement may arrive before its script's token; the script's end counts once the token was seen.
        gone = self._announced - scripts
        self._announced = scripts
        self._scripts = {each: ends for each, ends in self._scripts.items() if each not in gone}
        self._frozen = [each for each in entities if each.session not in scripts]

    def has_announced(self, session: str) -> bool:
        """Return whether a session belongs to a script that announces its endpoints."""
        return session in self._scripts

    def endpoint_nodes(self, kind: str, name: str) -> list[str]:
        return sorted({each.node for each in self._all() if each.kind == kind and each.name == name})

    def server(self, name: str) -> Entity | None:
        found = [each for each in self._all() if each.kind == "srv" and each.name == name]
        return min(found, key=lambda each: (each.node, each.session), default=None)

    def entries(self) -> list[GraphEntry]:
        ends = [each for each in self._all() if each.kind in ("pub", "sub", "srv")]
        return sorted(
            {GraphEntry(each.kind, each.node, each.name, "*" if each.record == "-" else each.record) for each in ends}
        )

    def nodes(self) -> list[str]:
        names = {each.node for each in self._all() if each.kind == "node"}
        return sorted(each for each in names if not each.rpartition("/")[2].startswith("_"))

    def _all(self) -> list[Entity]:
        if not self.begun:
            self.freeze()
        found = list(self._frozen)
        for script in self._scripts.values():
            found.append(Entity(script.session, "node", script.node, SCRIPT))
            found += [Entity(script.session, each.kind, script.node, each.name, each.type) for each in script.ends]  # type: ignore[arg-type]
        return found


def encode_announcement(node: str, session: str, ends: tuple[Endpoint, ...]) -> bytes:
    """Return the payload that announces a script's publications, subscriptions and services."""
    return encode(ScriptEnds(node, session, ends))
