"""Hearing a topic whatever its type: each sample with its number, its sender and what was lost before it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

from messages.base import counted
from messages.names import key as key_of
from services.runtime.inputs import EVENTS
from services.runtime.network.sequences import Sequences, Verdict
from services.runtime.network.transport import Inlet, Transport
from services.runtime.network.wire import FORMAT, Origin, detach


class Heard(NamedTuple):
    """One sample; ``type`` is the ROS type that its sender told, or empty; times in ns of the wall clock.

    ``sent`` is the sender's clock, or the arrival when a foreign sender (``origin`` None) told none.
    """

    payload: bytes
    origin: Origin | None
    type: str
    arrived: int
    lost: int

    @property
    def sent(self) -> int:
        """When it was sent."""
        return self.arrived if self.origin is None else self.origin.source_ns


class Listener:
    """A subscription without a type. What a slow reader misses is counted by the numbers of what it gets.

    ``left_out`` counts what came twice, and numbers that cannot be true.
    """

    def __init__(self, transport: Transport, name: str, latched: bool = False) -> None:
        self.name = name
        self.inlet: Inlet = transport.subscribe(key_of(name), EVENTS, latched)
        self.received = self.lost = self.foreign = self.left_out = 0
        self._sequences = Sequences()

    def take(self) -> Iterator[Heard]:
        """What has come, oldest first; what came twice is left out."""
        while (sample := self.inlet.take()) is not None:
            payload, attachment, source = sample
            origin, lost = detach(attachment), 0
            if origin is None:
                self.foreign += 1
            else:
                verdict = self._sequences.judge(origin)
                if verdict in (Verdict.REPEATED, Verdict.TOO_FAR):
                    self.left_out += 1
                    continue
                if verdict is Verdict.GAP:
                    lost = origin.sequence - self._sequences.last[origin.publisher] - 1
                self._sequences.accept(origin)
            self.received += 1
            self.lost = counted(self.lost, lost)
            form, _, type_name = self.inlet.encoding(source).partition(";")
            yield Heard(payload, origin, type_name if form == FORMAT else "", time.time_ns(), lost)

    def close(self) -> None:
        """End the subscription."""
        self.inlet.close()
