"""What a script sees of the network in lockstep: the same at the same tick of every run.

A liveliness token arrives when it arrives. So the scripts of a fleet tell each other what they publish, read and serve
by a topic, which lockstep orders like all others; of other nodes the tokens count, as of the start of the tick.
"""

from __future__ import annotations

from typing import Any

import msgspec

from messages.base import DECODE_ERRORS, encode, raw_decoder
from messages.names import key as key_of
from messages.topics import Quality, Topic
from services.runtime.graph import Entity
from services.runtime.transport.api import Transport
from services.runtime.transport.wire import publisher_id
from services.script.api import GraphEntry, Origin
from services.script.network import Network
from services.script.topics import record_of

ENDS: Topic[Any] = Topic(
    "/_scripts",
    record_of("elea_msgs/ScriptEnds"),
    0,
    Quality.LATCHED,
    "what a script publishes, reads and serves",
    1 << 20,
)
SCRIPT = "script"
"""The kind of node, as its token states it."""
ANNOUNCING = (SCRIPT, "turtlesim")
"""The kinds of nodes that announce what they have; their tokens do not count."""


class End(msgspec.Struct, frozen=True):
    """A publication, subscription or service of a script."""

    kind: str
    name: str
    type: str
    latched: bool = False


class ScriptEnds(msgspec.Struct, frozen=True):
    """All that a script publishes, reads and serves."""

    node: str
    session: str
    ends: tuple[End, ...] = ()


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
        """Whether there was a tick; before, the tokens count as they arrive."""

    def receive(self, payload: bytes) -> bool:
        """Read the announcement of another script; returns whether it could be read."""
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
        """From now on, until the next call, the tokens that have arrived so far count."""
        if self._seen == self.version:
            return
        self._seen = self.version
        with self._lock:
            entities = list(self._entities.values())
        scripts = {each.session for each in entities if each.kind == "node" and each.name in ANNOUNCING}
        # An announcement may come before the token of its script; its going counts once the token was here.
        gone = self._announced - scripts
        self._announced = scripts
        self._scripts = {each: ends for each, ends in self._scripts.items() if each not in gone}
        self._frozen = [each for each in entities if each.session not in scripts]

    def has_announced(self, session: str) -> bool:
        """Whether a session is that of a script that steps with this one."""
        return session in self._scripts

    def ends(self, kind: str, name: str) -> list[str]:
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


def encode_announcement(node: str, session: str, ends: tuple[End, ...]) -> bytes:
    """The payload that announces what a script publishes, reads and serves."""
    return encode(ScriptEnds(node, session, ends))
