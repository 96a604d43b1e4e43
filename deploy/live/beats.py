"""Heartbeats: what nodes say of themselves, once a second of wall time."""

from __future__ import annotations

from collections.abc import Collection

from deploy.live.listener import Listener
from deploy.live.session import Session
from messages.base import WrongPayload, decoder
from messages.elea import Health
from messages.topics import HEALTH

WITHIN_S = 1.3
"""A heartbeat comes once a second; what has none for longer than this is busy, stopped or hung."""

_read = decoder(Health)


class Beats:
    """The newest heartbeat of each node."""

    def __init__(self, live: Session) -> None:
        self._listener = Listener(live.transport, HEALTH.name)
        self.inlet = self._listener.inlet
        self.of: dict[str, Health] = {}

    def follow(self) -> None:
        """Take what has come."""
        for heard in self._listener.take():
            try:
                beat = _read(heard.payload)
            except WrongPayload:
                continue
            self.of[beat.node] = beat


def hear(live: Session, nodes: Collection[str]) -> dict[str, Health]:
    """The heartbeats of these nodes, as soon as all have come; of those that came, after WITHIN_S."""
    beats = Beats(live)
    for _ in live.turns(beats.inlet, WITHIN_S):
        beats.follow()
        if beats.of.keys() >= set(nodes):
            break
    return beats.of
