"""The heartbeat of a node, sent by its loop, so that a hung loop sends none."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any, Literal

from messages.base import MOST_COUNTED, encode
from messages.elea import Health
from messages.topics import HEALTH
from services.runtime.log import Log
from services.runtime.publisher import Publisher
from services.runtime.subscriber import Subscriber
from services.runtime.transport.request_queue import Refusals
from services.runtime.transport.sequences import RefusalCounter

PERIOD_S = 1.0
"""Wall time [s] between two heartbeats. With half of it, healthy loops looked hung on a machine with eight busy
processes on two cores."""

LISTED_BYTES = 28_000
"""Maximum bytes of a heartbeat's inputs, and of its outputs: about 170 topics each; both fit ``HEALTH.largest``."""
_ENTRY_BYTES = 128
"""Size of an entry without its texts: field names, and seven counts of nine bytes."""
_LONGEST_NAME = 1000
"""Maximum characters of a listed topic's name; names that a node accepts are shorter."""
_NOTE_BYTES = 4000
_COUNTS = ("received", "lost", "refused", "repeated", "resynced", "foreign")

State = Literal["starting", "waiting", "running", "paused", "stopping"]

End = Subscriber[Any] | RefusalCounter | Publisher[Any]


class Heartbeat:
    """Publishes the health of a node once a period, and at once for a new subscriber."""

    def __init__(self, node: str, log: Log | None = None) -> None:
        self.state: State = "starting"
        self.detail = ""
        self.ticks = self.missed = 0
        self._node, self._log = node, log
        self._inputs, self._outputs = _Listing(), _Listing()
        self._complained = False
        self._beats = 0
        self._due = 0.0
        self._had_subscribers = False

    def is_due(self, output: Publisher[Health]) -> bool:
        """Return whether a heartbeat is due; called in each turn of the loop."""
        before, self._had_subscribers = self._had_subscribers, output.has_subscribers
        return time.monotonic() >= self._due or self._had_subscribers > before

    def publish(
        self,
        output: Publisher[Health],
        inputs: Sequence[Subscriber[Any] | RefusalCounter],
        outputs: Sequence[Publisher[Any]],
        refusals: Refusals,
    ) -> None:
        """Publish the node's health."""
        self._due = time.monotonic() + PERIOD_S
        self._beats += 1
        output.publish_encoded(self.payload(inputs, outputs, refusals))

    def request_now(self) -> None:
        """Make the next heartbeat due at once, as the state has changed."""
        self._due = 0.0

    def payload(
        self,
        inputs: Sequence[Subscriber[Any] | RefusalCounter],
        outputs: Sequence[Publisher[Any]],
        refusals: Refusals,
    ) -> bytes:
        """Encode the health. Topics that cannot be encoded are left out and logged once: a working node never looks
        hung."""
        try:
            payload = encode(self._health(inputs, outputs, refusals))
            if len(payload) <= HEALTH.largest:
                return payload
            problem = f"it has {len(payload)} bytes, the limit is {HEALTH.largest}"
        except (OverflowError, ValueError, TypeError) as error:
            problem = str(error)
        if self._log is not None and not self._complained:
            self._complained = True
            self._log.error(f"heartbeats carry totals only, without counts per topic: {problem}")
        return encode(self._health(inputs, outputs, refusals, listed=False))

    def _health(
        self,
        inputs: Sequence[Subscriber[Any] | RefusalCounter],
        outputs: Sequence[Publisher[Any]],
        refusals: Refusals,
        listed: bool = True,
    ) -> Health:
        totals = {name: min(sum(getattr(each, name) for each in inputs), MOST_COUNTED) for name in _COUNTS}
        return Health(
            node=self._node,
            pid=os.getpid(),
            beat=self._beats,
            state=self.state,
            note=self.detail.encode(errors="replace")[:_NOTE_BYTES].decode(errors="ignore"),
            ticks=self.ticks,
            missed=self.missed,
            inputs=tuple(self._inputs.next(inputs)) if listed else (),
            outputs=tuple(self._outputs.next(outputs)) if listed else (),
            reads=len(inputs),
            writes=len(outputs),
            sent=min(sum(each.sent for each in outputs), MOST_COUNTED),
            **totals,
            refused_requests=refusals.count,
            request_reason=refusals.reason[:200],
        )


class _Listing:
    """Selects the ends that a heartbeat lists: all if they fit, else those with new faults, then the others in turn."""

    def __init__(self) -> None:
        self._next = 0
        self._listed_faults: dict[str, int] = {}

    def next(self, ends: Sequence[End]) -> list[Any]:
        """Return the health of the selected ends, in the order given; ends with new faults get half of the bytes."""
        count, room = len(ends), LISTED_BYTES
        first = self._next % count if count else 0
        turns = [i for i in (*range(first, count), *range(first)) if len(ends[i].name) <= _LONGEST_NAME]
        if len(self._listed_faults) > count:
            there = {each.name for each in ends}
            self._listed_faults = {name: faults for name, faults in self._listed_faults.items() if name in there}
        chosen: dict[int, Any] = {}
        for index in turns:
            if room < LISTED_BYTES // 2:
                break
            if _fault_count(ends[index]) != self._listed_faults.get(ends[index].name, 0):
                room -= self._choose(index, ends[index], chosen, room)
        for index in turns:
            if index not in chosen:
                taken = self._choose(index, ends[index], chosen, room)
                if not taken:
                    break
                room -= taken
            self._next = index + 1
        return [chosen[index] for index in sorted(chosen)]

    def _choose(self, index: int, end: End, chosen: dict[int, Any], room: int) -> int:
        """List an end if it fits into ``room`` bytes; returns the bytes used, 0 if it does not fit."""
        health = end.health()
        size = _ENTRY_BYTES + len(health.topic.encode()) + len(getattr(health, "reason", "").encode(errors="replace"))
        if size > room:
            return 0
        chosen[index] = health
        self._listed_faults[end.name] = _fault_count(end)
        return size


def _fault_count(end: End) -> int:
    return end.lost + end.refused + end.repeated + end.resynced if isinstance(end, Subscriber) else 0
