"""Subscribers of the command line: any topic without its type, the simulation clock, and heartbeats."""

from __future__ import annotations

import time
from collections.abc import Collection

from deploy.live.connect import spin
from messages.base import Message, WrongPayload, decoder
from messages.elea import Health, InputHealth, OutputHealth
from messages.rosgraph import Clock
from messages.std import Header, Time, stamp_of
from messages.topics import CLOCK, HEALTH
from services.runtime.clock_map import ClockMap
from services.runtime.light_node import LightNode
from services.runtime.subscriber import ReceivedSample, UntypedSubscriber
from services.runtime.transport.api import Transport

INPUT_COUNTS = ("received", "lost", "refused", "repeated", "resynced", "foreign")
"""The counters of ``InputHealth``, in the order in which they are shown."""

_MAX_CLOCKS = 4096
"""Maximum number of stored clock messages; more than a minute at 50 Hz."""


class _WithStamp(Message, frozen=True, kw_only=True):
    """The fields of a message that may contain its time: its header, its first transform's header,
    or the clock itself.
    """

    header: Header | None = None
    clock: Time | None = None
    transforms: tuple[_WithHeader, ...] = ()


class _WithHeader(Message, frozen=True, kw_only=True):
    header: Header = Header()


_decode_stamped = decoder(_WithStamp)
_decode_clock = decoder(Clock)


def header_stamp(payload: bytes) -> int | None:
    """Return the simulation time stamp [ns] of a message of any type; None if it has no stamp, or one of 0."""
    try:
        found = _decode_stamped(payload)
    except WrongPayload:
        return None
    stamp = stamp_of(found)
    return stamp if stamp or found.clock is not None else None


class ClockSubscriber:
    """Follows ``/clock``; ``now`` [ns] is None until a sample arrives, ``epoch`` increases at each reset.

    ``since`` is the wall time [ns] of the first sample of the current epoch.
    """

    def __init__(self, transport: Transport) -> None:
        self._listener = UntypedSubscriber(transport, CLOCK.name)
        self.raw = self._listener.raw
        self.now: int | None = None
        self.epoch = 0
        self.since = 0
        self.paused = False
        self._map = ClockMap(_MAX_CLOCKS)

    def update(self) -> None:
        """Read new messages."""
        for sample in self._listener.drain():
            try:
                clock = _decode_clock(sample.payload)
            except WrongPayload:
                continue
            if clock.epoch != self.epoch:
                self._map.clear()
                self.since = sample.sent_ns
            self.now, self.epoch, self.paused = clock.clock.ns, clock.epoch, clock.paused
            if sample.lost:
                self._map.lose()
            if self._map.add(sample.sent_ns, clock.clock.ns):
                self.since = min(self.since, sample.sent_ns)

    def covers(self, moment: int) -> bool:
        """Return whether a clock sent after this wall time [ns] has arrived, so that ``time_at`` is final."""
        return self._map.past(moment)

    def time_at(self, moment: int) -> int | None:
        """Return the simulation time [ns] at a wall time [ns]: that of the last clock sent before it.

        None before the first clock, and where a lost one may have been sent before that wall time.
        """
        return self._map.before(moment)

    def sample_time(self, sample: ReceivedSample) -> int | None:
        """Return the simulation time of a sample [ns]: its stamp, or the clock when it was sent; None if unknown."""
        stamp = header_stamp(sample.payload)
        return self.time_at(sample.sent_ns) if stamp is None else stamp


HEARTBEAT_TIMEOUT_S = 1.3
"""Wall time [s] without a heartbeat, which is published once a second, after which a node is busy, stopped or hung."""
MAX_HEARTBEATS = 24
"""Maximum number of heartbeats to wait for from a node with so many topics that each lists only some of them."""

_decode_health = decoder(Health)


class HeartbeatSubscriber:
    """The latest heartbeat of each node, and the last counts of its topics, of which a heartbeat may list only some."""

    def __init__(self, live: LightNode) -> None:
        self._listener = UntypedSubscriber(live.transport, HEALTH.name)
        self.raw = self._listener.raw
        self.latest: dict[str, Health] = {}
        self._inputs: dict[str, dict[str, InputHealth]] = {}
        self._outputs: dict[str, dict[str, OutputHealth]] = {}

    def update(self) -> None:
        """Read new messages."""
        for sample in self._listener.drain():
            try:
                beat = _decode_health(sample.payload)
            except WrongPayload:
                continue
            known = self.latest.get(beat.node)
            if known is None or known.pid != beat.pid:
                self._inputs[beat.node], self._outputs[beat.node] = {}, {}
            self.latest[beat.node] = beat
            self._inputs[beat.node] |= {each.topic: each for each in beat.inputs}
            self._outputs[beat.node] |= {each.topic: each for each in beat.outputs}

    def inputs(self, node: str) -> dict[str, InputHealth]:
        """Return the health of a node's subscriptions, by topic."""
        return self._inputs.get(node, {})

    def outputs(self, node: str) -> dict[str, OutputHealth]:
        """Return the health of a node's publications, by topic."""
        return self._outputs.get(node, {})

    def is_complete(self, node: str) -> bool:
        """Return whether a node has reported all its topics."""
        beat = self.latest.get(node)
        if beat is not None and len(beat.inputs) >= beat.reads and len(beat.outputs) >= beat.writes:
            return True
        return beat is not None and len(self.inputs(node)) >= beat.reads and len(self.outputs(node)) >= beat.writes


def collect_heartbeats(live: LightNode, nodes: Collection[str]) -> HeartbeatSubscriber:
    """Collect the heartbeats of these nodes, until all have arrived; after HEARTBEAT_TIMEOUT_S, of those that
    responded.

    For nodes with very many topics, waits until all were listed, at most MAX_HEARTBEATS heartbeats.
    """
    beats, begun = HeartbeatSubscriber(live), time.monotonic()
    for _ in spin(live, beats.raw, HEARTBEAT_TIMEOUT_S * MAX_HEARTBEATS):
        beats.update()
        responded = beats.latest.keys() & set(nodes)
        if all(map(beats.is_complete, responded)) and (
            len(responded) == len(nodes) or time.monotonic() - begun > HEARTBEAT_TIMEOUT_S
        ):
            break
    return beats
