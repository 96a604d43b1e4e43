"""A subscription to a topic whose type is not known in advance, which counts what it loses."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

from messages.base import saturating_add
from messages.names import key as key_of
from services.runtime.subscriber import EVENT_QUEUE_SIZE
from services.runtime.transport.api import RawSubscriber, Transport
from services.runtime.transport.sequences import SequenceTracker, Verdict
from services.runtime.transport.wire import FORMAT, SampleInfo, unpack_attachment


class ReceivedSample(NamedTuple):
    """One sample; ``type`` is the ROS type that its sender told, or empty; times in ns of the wall clock.

    ``sent_ns`` is the sender's clock, or the arrival when a foreign sender (``origin`` None) told none.
    """

    payload: bytes
    origin: SampleInfo | None
    type: str
    received_ns: int
    lost: int

    @property
    def sent_ns(self) -> int:
        """When it was sent."""
        return self.received_ns if self.origin is None else self.origin.source_ns


class UntypedSubscriber:
    """A subscription without a type. What a slow reader misses is counted by the numbers of what it gets.

    ``discarded`` counts what came twice, and numbers that cannot be true.
    """

    def __init__(
        self, transport: Transport, name: str, latched: bool = False, capacity: int = EVENT_QUEUE_SIZE
    ) -> None:
        self.name = name
        self.inlet: RawSubscriber = transport.subscribe(key_of(name), capacity, latched)
        self.received = self.lost = self.foreign = self.discarded = 0
        self._sequences = SequenceTracker()

    def drain(self) -> Iterator[ReceivedSample]:
        """What has come, oldest first; what came twice is left out."""
        while (sample := self.inlet.recv()) is not None:
            payload, attachment, source = sample
            origin, lost = unpack_attachment(attachment), 0
            if origin is None:
                self.foreign += 1
            else:
                verdict = self._sequences.judge(origin)
                if verdict in (Verdict.REPEATED, Verdict.TOO_FAR):
                    self.discarded += 1
                    continue
                if verdict is Verdict.GAP:
                    lost = origin.sequence - self._sequences.last[origin.publisher] - 1
                self._sequences.accept(origin)
            self.received += 1
            self.lost = saturating_add(self.lost, lost)
            form, _, type_name = self.inlet.encoding(source).partition(";")
            yield ReceivedSample(payload, origin, type_name if form == FORMAT else "", time.time_ns(), lost)

    def close(self) -> None:
        """End the subscription."""
        self.inlet.close()
