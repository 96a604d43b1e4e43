"""Heartbeats: what nodes say of themselves, once a second of wall time."""

from __future__ import annotations

import time
from collections.abc import Collection

from deploy.live.listener import Listener
from deploy.live.session import Session
from messages.base import WrongPayload, decoder
from messages.elea import Health, InputHealth, OutputHealth
from messages.topics import HEALTH

WITHIN_S = 1.3
"""A heartbeat comes once a second; what has none for longer than this is busy, stopped or hung."""
MOST_BEATS = 24
"""Heartbeats that are awaited for a node of so many topics that each beat lists a part of them."""

_read = decoder(Health)


class Beats:
    """The newest heartbeat of each node, and the last counts of its topics, of which a beat may list a part."""

    def __init__(self, live: Session) -> None:
        self._listener = Listener(live.transport, HEALTH.name)
        self.inlet = self._listener.inlet
        self.of: dict[str, Health] = {}
        self._inputs: dict[str, dict[str, InputHealth]] = {}
        self._outputs: dict[str, dict[str, OutputHealth]] = {}

    def follow(self) -> None:
        """Take what has come."""
        for heard in self._listener.take():
            try:
                beat = _read(heard.payload)
            except WrongPayload:
                continue
            known = self.of.get(beat.node)
            if known is None or known.pid != beat.pid:
                self._inputs[beat.node], self._outputs[beat.node] = {}, {}
            self.of[beat.node] = beat
            self._inputs[beat.node] |= {each.topic: each for each in beat.inputs}
            self._outputs[beat.node] |= {each.topic: each for each in beat.outputs}

    def inputs(self, node: str) -> dict[str, InputHealth]:
        """What a node has told of what it reads, by topic."""
        return self._inputs.get(node, {})

    def outputs(self, node: str) -> dict[str, OutputHealth]:
        """What a node has told of what it writes, by topic."""
        return self._outputs.get(node, {})

    def whole(self, node: str) -> bool:
        """Whether a node has told of all its topics."""
        beat = self.of.get(node)
        if beat is not None and len(beat.inputs) >= beat.reads and len(beat.outputs) >= beat.writes:
            return True
        return beat is not None and len(self.inputs(node)) >= beat.reads and len(self.outputs(node)) >= beat.writes


def hear(live: Session, nodes: Collection[str]) -> Beats:
    """The heartbeats of these nodes, as soon as all have come; of those that came, after WITHIN_S.

    Of nodes with very many topics, as many beats as it takes until each was listed, at most MOST_BEATS.
    """
    beats, begun = Beats(live), time.monotonic()
    for _ in live.turns(beats.inlet, WITHIN_S * MOST_BEATS):
        beats.follow()
        heard = beats.of.keys() & set(nodes)
        if all(map(beats.whole, heard)) and (len(heard) == len(nodes) or time.monotonic() - begun > WITHIN_S):
            break
    return beats
