"""Claims the names of a process's nodes: no two nodes of a network have the same name.

A new node's own token reaches the router before its query. So if two nodes of the same name start at the same moment,
at least one of them learns of the other.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

from services.runtime.discovery import known_nodes
from services.runtime.errors import TryAgain
from services.runtime.graph import REPLACED, Entity, Kind, shutdown_key, token_pattern
from services.runtime.transport.api import TIMEOUT, Token, Transport

TAKEOVER_S = 1.5
"""Wall time [s] within which the token of a killed predecessor has disappeared."""
ASK_S = 0.5
"""Wall time [s] that a node has to accept a shutdown request."""


def claim_names(transport: Transport, nodes: Sequence[Entity], replaces: bool = False) -> list[Token]:
    """Claim the names of ``nodes``, all of this session, with one wait for all; returns their tokens.

    With ``replaces``, the current holders of a name are asked to end; those that may be replaced do.

    Raises:
        TryAgain: Another process holds one of the names and does not end.
    """
    tokens = [transport.declare_token(each.key) for each in nodes]
    settle = transport.settle_s
    if _sees_everybody(transport):
        if not _others(transport, nodes):
            return tokens
        settle *= 2  # another node may start at the same moment, and need as long to see all others
    started = seen = time.monotonic()
    answered: set[str] = set()
    going: set[str] = set()
    while True:
        rivals = {each.node: found for each in nodes if (found := _rivals(transport, each))}
        for name in rivals if replaces else ():
            for each in _sessions(transport, "pub", name) - {transport.session} - answered:
                accepts = ask_to_end(transport, each, name, REPLACED)
                answered |= set() if accepts is None else {each}  # one that is too busy to answer is asked again
                going |= {each} if accepts else set()
        now = time.monotonic()
        if now - started > TAKEOVER_S:  # one that has agreed to end may take longer to shut down
            rivals = {name: left for name, found in rivals.items() if (left := sorted({*found} - going))}
        # While links come up, an existing token may be invisible for a moment.
        seen = now if rivals else seen
        if not rivals and now - seen >= settle:
            return tokens
        if rivals and now - started > TAKEOVER_S:
            name, sessions = next(iter(rivals.items()))
            raise TryAgain(
                f"a node {name} is already there (session {sessions[0]}): "
                "give this one another --name or --namespace, or stop the other"
            )
        time.sleep(0.02)


def ask_to_end(transport: Transport, session: str, node: str, reason: str) -> bool | None:
    """Ask a node to end; returns whether it accepts, None if it does not answer in time."""
    replies = transport.query(shutdown_key(session, node), reason.encode(), ASK_S)
    if any(not each.ok and each.payload == TIMEOUT for each in replies):
        return None
    return any(each.ok for each in replies)


def _sees_everybody(transport: Transport) -> bool:
    """Wait until all nodes that the router knows are visible; False if the router does not answer or it takes too
    long."""
    deadline = time.monotonic() + transport.settle_s
    while (expected := known_nodes(transport)) is not None and time.monotonic() < deadline:
        if expected <= set(transport.tokens(token_pattern("node"))):
            return True
        time.sleep(0.01)
    return False


def _others(transport: Transport, nodes: Sequence[Entity]) -> bool:
    """Return whether any other session holds one of the names."""
    if len(nodes) == 1:
        return bool(_sessions(transport, "node", nodes[0].node) - {transport.session})
    names = {each.node for each in nodes}
    found = map(Entity.parse, transport.tokens(token_pattern("node")))
    return any(each is not None and each.node in names and each.session != transport.session for each in found)


def _rivals(transport: Transport, node: Entity) -> list[str]:
    """Return the sessions with a better claim to the name: those that publish under it, else claims of lower ids."""
    mine = transport.session
    at_work = _sessions(transport, "pub", node.node) - {mine}
    return sorted(at_work) or sorted(each for each in _sessions(transport, "node", node.node) if each < mine)


def _sessions(transport: Transport, kind: Kind, node: str) -> set[str]:
    found = (Entity.parse(key) for key in transport.tokens(token_pattern(kind, node)))
    return {each.session for each in found if each}
