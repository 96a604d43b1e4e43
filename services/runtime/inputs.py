"""What a node reads: samples checked, counted and admitted at the start of a tick."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Any, Generic, TypeVar

from messages.base import FAULTS, Message, bare_decoder
from messages.elea import InputHealth
from messages.topics import Quality, Topic
from services.runtime.lockstep.marks import Marks
from services.runtime.network.transport import Inlet, Sample, Transport
from services.runtime.network.wire import MEMBER_BYTES, NODE_BYTES, Origin, detach, encoding, member_id

M = TypeVar("M", bound=Message)

CAPACITY = 1024
"""Samples kept between two looks; more than any topic brings in a tick of the slowest reader."""
EVENTS = 8192
"""The same for events, of which every one is to arrive: a reader of bursts may lag behind by as many."""

PATIENCE_S = 2.0
"""Wall time that lockstep waits for a sample that was sent before it gives it up as lost."""


class Input(Generic[M]):
    """One subscription. Its owner calls ``admit`` once a tick; ``batch`` then holds what is new, oldest first.

    Refused (wrong type, undecodable, too large) and lost samples (gaps in the numbers) are counted, never passed on.
    A sample without our attachment is foreign: it is taken if it decodes. A ``raw`` input gives bare payloads.
    """

    def __init__(self, topic: Topic[M], name: str, key: str, transport: Transport, raw: bool = False) -> None:
        self.topic, self.name, self.key = topic, name, key
        self.encoding = encoding(topic.record.ROS_TYPE)
        self._capacity = EVENTS if topic.quality is Quality.EVENT else CAPACITY
        self.inlet: Inlet = transport.subscribe(key, self._capacity, topic.quality is Quality.LATCHED)
        self.batch: list[tuple[M, Origin | None]] = []
        self.received = self.lost = self.refused = self.foreign = 0
        self.reason = ""
        self._largest = topic.largest
        self._only = member_id(topic.only, "")[:NODE_BYTES] if topic.only else b""
        self._strict = topic.quality in (Quality.COMMAND, Quality.LATCHED)
        self._decode: Callable[[bytes], Any] = bytes if raw else bare_decoder(topic.record)
        self._last: dict[bytes, int] = {}
        self._held: deque[tuple[M, Origin]] = deque()

    def admit(self, marks: Marks | None = None) -> None:
        """Take what has come. With ``marks`` (lockstep), members' samples wait until their tick is over."""
        fresh = self._drain()
        if marks is None:
            self.batch = [*self._held, *fresh] if self._held else fresh
            self._held.clear()
            return
        if awaited := marks.awaited.get(self.key):
            self._await(awaited, fresh)
        if not fresh and not self._held:
            self.batch = fresh
            return
        reached = marks.reached.get(self.key, {})
        ready: list[tuple[M, Origin | None]] = []
        waiting: deque[tuple[M, Origin]] = deque()
        for message, origin in (*self._held, *fresh):
            governed = origin is not None and origin.publisher[:MEMBER_BYTES] in marks.members
            if governed and origin is not None and origin.sequence > reached.get(origin.publisher, 0):
                waiting.append((message, origin))
            else:
                ready.append((message, origin))
        if len(ready) > 1:
            ready.sort(key=_order)
        self.batch, self._held = ready, waiting

    def next(self) -> M | None:
        """The next message, for who answers to each as it comes, without time; None when nothing is there."""
        while (sample := self.inlet.take()) is not None:
            if (entry := self._open(sample)) is not None:
                return entry[0]
        return None

    def close(self) -> None:
        """End the subscription."""
        self.inlet.close()

    def refuse(self, reason: str) -> None:
        """Count a sample as refused, as its owner does with one that decodes and still makes no sense."""
        self.refused += 1
        self.reason = reason[:200]

    def health(self) -> InputHealth:
        """The counts, as they are shown."""
        return InputHealth(
            topic=self.name,
            received=self.received,
            lost=self.lost,
            refused=self.refused,
            foreign=self.foreign,
            reason=self.reason,
        )

    def _drain(self) -> list[tuple[M, Origin | None]]:
        """What is there, at most as much as the ring holds: in a flood, more comes for as long as one takes."""
        taken: list[tuple[M, Origin | None]] = []
        open_ = self._open
        for sample in islice(iter(self.inlet.take, None), self._capacity):
            if (entry := open_(sample)) is not None:
                taken.append(entry)
        return taken

    def _open(self, sample: Sample) -> tuple[M, Origin | None] | None:
        """The message in a sample that is new, meant for this topic and of its type; gaps before it count as lost.

        Asking for key and type takes 2 us: it is done for each command, for what has no publisher, and else for the
        first sample of a publisher. The rest takes about 2 us for an Odometry.
        """
        payload, attachment, source = sample
        origin = detach(attachment)
        if origin is None:
            if not self._meant(source, None):
                return None
            self.foreign += 1
        else:
            sequence, _, _, publisher = origin
            last = self._last.get(publisher)
            if (last is None or self._strict) and not self._meant(source, origin):
                return None
            if last is None:
                if len(self._last) >= CAPACITY:
                    self._last.pop(next(iter(self._last)))
            elif sequence != last + 1:
                if sequence <= last:
                    return None
                self.lost += sequence - last - 1
            self._last[publisher] = sequence
        if len(payload) > self._largest:
            self.refuse(f"{len(payload)} bytes, the limit is {self._largest}")
            return None
        try:
            message = self._decode(payload)
        except FAULTS as error:
            self.refuse(str(error))
            return None
        self.received += 1
        return message, origin

    def _meant(self, source: Any, origin: Origin | None) -> bool:
        """A put to a wildcard reaches every topic that it covers, and is meant for none of them.

        A topic of one node's alone takes nothing from others.
        """
        key, kind = self.inlet.key(source), self.inlet.encoding(source)
        if key != self.key:
            self.refuse(f"sent to {key[:80]!r}, not to this topic alone")
        elif kind and kind != self.encoding:
            self.refuse(f"expected {self.encoding}, got {kind[:80]}")
        elif self._only and (origin is None or origin.publisher[:NODE_BYTES] != self._only):
            self.refuse(f"not from the node {self.topic.only}, which alone may publish it")
        else:
            return True
        return False

    def _await(self, awaited: dict[bytes, int], fresh: list[tuple[M, Origin | None]]) -> None:
        """Block until every awaited sample is there; what does not come within PATIENCE_S is counted as lost."""
        deadline = 0.0
        while missing := [each for each, number in awaited.items() if self._last.get(each, 0) < number]:
            if deadline == 0.0:
                deadline = time.monotonic() + PATIENCE_S
            elif time.monotonic() > deadline:
                for publisher in missing:
                    self.lost += awaited[publisher] - self._last.get(publisher, awaited[publisher] - 1)
                    self._last[publisher] = awaited[publisher]
                return
            else:
                time.sleep(0.00005)
            fresh += self._drain()


def _order(entry: tuple[Message, Origin | None]) -> tuple[bytes, bytes, int]:
    """Senders by name, then topic, then number: the same in every run, whatever the network's timing."""
    origin = entry[1]
    if origin is None:
        return b"", b"", 0
    return origin.publisher[:NODE_BYTES], origin.publisher[MEMBER_BYTES:], origin.sequence
