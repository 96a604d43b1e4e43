"""The graph of nodes: liveliness tokens for publications, subscriptions, requests and steps, read without a daemon."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

from messages.names import BadName, mangle, unmangle
from messages.names import key as absolute
from services.runtime.transport.api import ADMIN_SPACE, Transport

SUPERVISOR = "/supervisor"
"""The name of the supervisor's node."""

EVERYTHING = f"{ADMIN_SPACE}/*/*/*/*/*/*"
PATIENCE_S = 5.0
"""Wall time [s] to wait for all tokens of the network; a fleet of a hundred robots has 5,000, and a router that shares
its processor was seen to take more than a second for them."""

_SESSION = re.compile(r"[0-9a-f]{1,32}")
_PERIOD = re.compile(r"[1-9][0-9]{0,17}")
_COUNT = re.compile(r"[1-9][0-9]{0,4}")

Kind = Literal["node", "pub", "sub", "srv", "step", "ready"]
"""A node itself, a publication, a subscription, a request served, readiness to step with the simulation, or the
readiness of a node that takes no steps."""
_KINDS = frozenset(get_args(Kind))


@dataclass(frozen=True)
class Entity:
    """A parsed token. ``name`` is the topic or request, ``record`` its ROS type, ``detail`` the quality.

    The token of a node has its kind of service in ``name``; that of a stepping node has its period [ns] in ``detail``
    and, if several nodes of its process step together, their number in ``record``.
    """

    session: str
    kind: Kind
    node: str
    name: str = "-"
    record: str = "-"
    detail: str = "-"

    @property
    def key(self) -> str:
        """The Zenoh key of the token."""
        chunks = (self.session, self.kind, mangle(self.node), mangle(self.name), mangle(self.record), self.detail)
        return "/".join((ADMIN_SPACE, *chunks))

    @property
    def sharing(self) -> int:
        """The number of nodes of a stepping node's process that step together; 1 for other tokens."""
        return int(self.record) if self.kind == "step" and _COUNT.fullmatch(self.record) else 1

    @classmethod
    def parse(cls, key: str) -> Entity | None:
        """Parse a token's key; returns None if it is not one of ours.

        A key with a control character in any part is refused, too: it would reach terminals and logs.
        """
        chunks = key.split("/")
        if len(chunks) != 7 or chunks[0] != ADMIN_SPACE or chunks[2] not in _KINDS:
            return None
        _, session, kind, node, name, record, detail = chunks
        if not _SESSION.fullmatch(session) or (kind == "step" and not _PERIOD.fullmatch(detail)):
            return None
        try:
            absolute(unmangle(node))
            if kind in ("pub", "sub", "srv"):
                absolute(unmangle(name))
        except BadName:
            return None
        parts = unmangle(node), unmangle(name), unmangle(record), detail
        return cls(session, kind, *parts) if all(map(str.isprintable, parts)) else None  # type: ignore[arg-type]


def token_pattern(kind: Kind | Literal["*"] = "*", node: str = "*", name: str = "*") -> str:
    """Return the key expression of all tokens of a kind, node and topic or request."""
    chunks = [each if each == "*" else mangle(each) for each in (node, name)]
    return "/".join((ADMIN_SPACE, "*", kind, *chunks, "*", "*"))


def ping_key(session: str, node: str) -> str:
    """Return the key on which a node's own loop answers pings: with nothing, or with its health if asked for it."""
    return "/".join((ADMIN_SPACE, "ping", session, mangle(node)))


ALL_PINGS = "/".join((ADMIN_SPACE, "ping", "**"))
ASKS_HEALTH = b"health"
"""The payload of a ping that asks for the node's health."""


REPLACED = "new node registered with same name"
"""The reason in the shutdown request to a node whose name another one takes over."""


def shutdown_key(session: str, node: str) -> str:
    """Return the key of a node's shutdown requests, which carry the reason; a node that accepts one replies."""
    return "/".join((ADMIN_SPACE, "shutdown", session, mangle(node)))


def snapshot(transport: Transport) -> list[Entity]:
    """Query all entities on the network; raises TryAgain if it does not answer in time."""
    found = (Entity.parse(key) for key in transport.all_tokens(EVERYTHING, PATIENCE_S))
    return sorted((each for each in found if each), key=lambda e: (e.node, e.kind, e.name))
