"""Discovery: lists the nodes of the network, checks that they are reachable, and waits for those of a fleet.

Peers connect directly to each other, not through the router, and listen on their own machine only. So a peer on another
machine, or in another network namespace, that joins the same router cannot exchange anything with them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Set

import msgspec

from messages.base import DECODE_ERRORS, decoder, encode
from services.runtime.errors import list_names
from services.runtime.graph import Entity, ping_key, token_pattern
from services.runtime.log import Log
from services.runtime.transport.api import ADMIN_SPACE, PendingReplies, TokenWatch, Transport

DIRECTORY_KEY = f"{ADMIN_SPACE}/register"
DIRECTORY_TIMEOUT_S = 0.5
"""Wall time [s] to wait for the router's answer."""
DIRECTORY_LOOK_S = 0.05
"""Wall time [s] that the router waits for missing tokens; longer, and a hung node would delay all others."""


class NodeList(msgspec.Struct, frozen=True, array_like=True):
    """The tokens of all nodes."""

    nodes: tuple[str, ...] = ()


_read_nodes = decoder(NodeList)


class NodeDirectory:
    """The router's side: answers with the list of all nodes."""

    def __init__(self, transport: Transport) -> None:
        self._transport, self._server = transport, transport.serve(DIRECTORY_KEY)

    def answer(self) -> None:
        """Answer all waiting nodes with the same list; their own tokens have arrived before their queries."""
        waiting = list(iter(self._server.recv, None))
        if not waiting:
            return
        answer = encode(NodeList(tuple(self._transport.tokens(token_pattern("node"), DIRECTORY_LOOK_S))))
        for query in waiting:
            query.reply(answer)


def known_nodes(transport: Transport) -> frozenset[str] | None:
    """Query the tokens of all nodes that the router sees; None without a router, or without an answer in time."""
    for reply in transport.query(DIRECTORY_KEY, b"", DIRECTORY_TIMEOUT_S):
        try:
            return frozenset(_read_nodes(reply.payload).nodes)
        except DECODE_ERRORS:
            continue
    return None


REACH_FIRST_S = 2.0
"""Wall time [s] from joining to the first check: by then the links are up."""
REACH_RETRY_S = 1.0
"""Wall time [s] from a check that found the node cut off to the next one, which must confirm it."""
REACH_PERIOD_S = 10.0
"""Wall time [s] between checks that find no problem."""
_MAX_LISTED = 5
"""Maximum nodes listed in a message."""


def unreached(known: Set[str], seen: Set[str]) -> list[str]:
    """Return the names of the nodes that this node cannot see if it is cut off, else an empty list.

    It is cut off if it sees less than half of the known nodes. The others miss only one node, so they log nothing.

    Args:
        known: tokens of nodes that the router knows, without the node's own and the router's.
        seen: tokens of nodes that the node itself sees.
    """
    missed = known - seen
    if 2 * len(missed) <= len(known):
        return []
    found = (Entity.parse(key) for key in missed)
    return sorted(each.node for each in found if each is not None)


class ReachabilityCheck:
    """Checks periodically whether the node is cut off, and logs when that begins and ends."""

    def __init__(self, transport: Transport, log: Log) -> None:
        self._transport, self._log = transport, log
        self._due = time.monotonic() + REACH_FIRST_S
        self._watch: TokenWatch | None = None
        self._seen: set[str] = set()
        self._asked: PendingReplies | None = None
        self._suspected = self._logged = False

    def update(self) -> None:
        """Check if it is due; called by the loop, does not block."""
        if self._asked is None and time.monotonic() < self._due:
            return
        self._watch = self._watch or self._transport.watch(token_pattern("node"))
        while (event := self._watch.poll()) is not None:
            (self._seen.add if event.alive else self._seen.discard)(event.key)
        if self._asked is None:
            self._asked = self._transport.query_async(DIRECTORY_KEY, b"", DIRECTORY_TIMEOUT_S)
        elif (replies := self._asked.poll()) is not None:
            self._asked, self._due = None, time.monotonic() + REACH_PERIOD_S
            for reply in replies:
                if reply.ok:
                    self._judge(reply.payload)

    def _judge(self, answer: bytes) -> None:
        try:
            listed = frozenset(_read_nodes(answer).nodes)
        except DECODE_ERRORS:
            return
        found = {key: Entity.parse(key) for key in listed}
        known = {
            key
            for key, each in found.items()
            if each is not None and each.name != "router" and each.session != self._transport.session
        }
        missed = unreached(known, self._seen)
        if missed and not self._logged:
            self._due = time.monotonic() + REACH_RETRY_S
            if self._suspected:
                self._logged = True
                self._log.error(_unreachable_message(missed, len(known)))
        elif self._logged and not missed:
            self._logged = False
            self._log.info(f"this node now reaches the {len(known)} nodes that the router knows")
        self._suspected = bool(missed)


def _unreachable_message(missed: list[str], known: int) -> str:
    named = list_names(missed, _MAX_LISTED)
    return (
        f"this node is cut off from {len(missed)} of the {known} nodes that the router knows ({named}): in topology "
        "direct they talk to each other without the router, on links that end at their own machine or network "
        "namespace. Start this node with --topology star, which goes through the router"
    )


START_PATIENCE_S = 60.0
"""Wall time [s] without another node becoming ready after which a wait ends. A busy machine starts a fleet slowly, but
steadily."""


def missing_nodes(transport: Transport, roster: Iterable[str]) -> list[str]:
    """Return the nodes of the roster that have declared neither stepping nor readiness."""
    keys = [*transport.tokens(token_pattern("step")), *transport.tokens(token_pattern("ready"))]
    ready = {entity.node for entity in map(Entity.parse, keys) if entity is not None}
    return [node for node in roster if node not in ready]


def wait_for_nodes(
    transport: Transport,
    roster: Iterable[str],
    idle: Callable[[], None],
    patience_s: float = START_PATIENCE_S,
    on_wait: Callable[[list[str], float], None] | None = None,
    ended: Callable[[], Collection[str]] = tuple,
) -> list[str]:
    """Block until every node of the roster is ready.

    Args:
        transport: the network on which nodes declare that they are ready.
        roster: names of nodes.
        idle: called between two checks; it blocks for a moment.
        patience_s: wall time [s] without another node becoming ready after which the wait ends.
        on_wait: called at each check with the missing nodes and the wall time [s] waited.
        ended: nodes that have ended for good and are not waited for.

    Returns:
        The nodes that are not ready; empty when all are.
    """
    nodes = list(roster)
    started = renewed = time.monotonic()
    fewest = len(nodes) + 1
    while absent := missing_nodes(transport, nodes):
        now = time.monotonic()
        if len(absent) < fewest:
            fewest, renewed = len(absent), now
        gone = set(ended())
        awaited = [node for node in absent if node not in gone]
        if not awaited or now - renewed > patience_s:
            return absent
        if on_wait is not None:
            on_wait(awaited, now - started)
        idle()
    return []


TOKENS_TIMEOUT_S = 10.0
"""Wall time [s] that nodes have to answer before their tokens are taken as complete."""


def wait_for_tokens(transport: Transport, roster: Collection[str], idle: Callable[[], None]) -> None:
    """Block until the tokens have arrived that the nodes of the roster declared before this call.

    The tokens of each process come on a link of their own: those of a node that is ready say nothing about those that
    another one declared for it before. A node answers a ping on the same link, after its tokens. The wait ends after
    TOKENS_TIMEOUT_S in any case.

    Args:
        transport: the network.
        roster: names of nodes; those that are not on the network are ignored.
        idle: called between two checks; it blocks for a moment.
    """
    there = [each for each in map(Entity.parse, transport.tokens(token_pattern("node"))) if each is not None]
    pings = [
        transport.query_async(ping_key(each.session, each.node), b"", TOKENS_TIMEOUT_S, notify=transport.wake)
        for each in there
        if each.node in roster
    ]
    while any(each.poll() is None for each in pings):
        idle()
