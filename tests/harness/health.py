"""Asks a node's loop for its health; the next heartbeat would report the same up to a second later."""

from __future__ import annotations

from messages.base import decoder
from messages.elea import Health
from services.runtime.graph import ASKS_HEALTH, Entity, ping_key, token_pattern
from services.runtime.transport.api import Reply, Transport
from tests.harness.waiting import wait_until

_WITHIN_S = 60.0
"""Wall time for a node to appear and to answer, on a busy machine."""
_read_health = decoder(Health)


def ask_health(transport: Transport, node: str) -> Health:
    """Wait for the one node with this name and return its health."""

    def answers() -> list[Reply]:
        sessions = {each.session for each in map(Entity.parse, transport.tokens(token_pattern("node", node))) if each}
        return [each for one in sessions for each in transport.query(ping_key(one, node), ASKS_HEALTH, _WITHIN_S)]

    (reply,) = wait_until(answers, _WITHIN_S, f"an answer of {node}")
    assert reply.ok, f"{node} does not tell of its health: {reply.payload!r}"
    return _read_health(reply.payload)
