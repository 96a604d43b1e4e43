"""Paces a loop's ticks: by ``/clock``, or by the step grants of lockstep."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from itertools import islice
from typing import Any, NamedTuple, Protocol

from messages.base import WrongPayload, decoder
from messages.rosgraph import Clock
from messages.topics import CLOCK, Quality
from services.runtime.errors import TryAgain
from services.runtime.fleet_instances import describe_fleets, running_fleets
from services.runtime.graph import SUPERVISOR, Entity, token_pattern
from services.runtime.heartbeat import State
from services.runtime.lockstep.member import LINK_S, LockstepMember
from services.runtime.lockstep.protocol import SIMULATION, StepGrant, last_reported, sequence_numbers
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher, SendBuffer
from services.runtime.subscriber import Subscriber
from services.runtime.transport.api import RawSubscriber, Transport
from services.runtime.transport.sequences import RefusalCounter
from services.runtime.transport.wire import encoding, publisher_id, unpack_attachment

SILENCE_S = 0.5
"""Wall time [s] without a clock after which the node's state is ``waiting``."""

CLOCK_SILENCE_S = 3.0
"""Wall time [s] without a sample after which another publisher's clock is followed; a paused clock is still sent ten
times a second."""

PEER_CHECK_S = 0.05
"""Wall time [s] between two checks for peers that are not visible yet: each is a query to the network."""

POLL_S = 0.1
"""Wall time [s] for which a step waits for subscriptions of other members before the loop spins once."""

_CLOCKS = 16
"""Maximum clock samples queued and read at once; only the newest counts."""


class Instant(NamedTuple):
    """A point in simulation time [ns], its epoch (incremented by each reset), and the run of the simulation."""

    time: int
    epoch: int
    simulation: str


class Pacer(Protocol):
    """Gives the loop its next tick."""

    raw: RawSubscriber
    watermarks: Watermarks | None

    def start(self) -> None:
        """Begin ticking; called once all inputs are declared."""
        ...

    def next(self) -> Instant | None:
        """Return the next tick, or None if the loop has to wait."""
        ...

    def finish(self) -> None:
        """End the tick; called when its work is done."""
        ...

    def close(self) -> None:
        """Stop ticking."""
        ...


class HeartbeatStatus(Protocol):
    """State and detail of a heartbeat, or of several."""

    state: State
    detail: str


class SteppingNode(Protocol):
    """The part of a node that a pacer uses; also implemented by the nodes that form one lockstep member."""

    clock_patience_s: float
    refusal_counters: list[RefusalCounter]

    @property
    def transport(self) -> Transport: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def log(self) -> Log: ...
    @property
    def heartbeat(self) -> HeartbeatStatus: ...
    @property
    def send_buffer(self) -> SendBuffer: ...
    @property
    def subscribers(self) -> Sequence[Subscriber[Any]]: ...
    @property
    def publishers(self) -> Sequence[Publisher[Any]]: ...
    @property
    def version(self) -> int: ...


class ClockWatchdog:
    """Detects a missing clock and logs it once, with a ``hint`` for nodes that can work without one."""

    def __init__(self, node: SteppingNode, log: Log, hint: str = "") -> None:
        self._hint = f"; {hint}" if hint else ""
        self._heartbeat, self._log, self._patience = node.heartbeat, log, node.clock_patience_s
        self._transport = node.transport
        self._last_sample = time.monotonic()
        self._ever = self._logged = False

    def note_sample(self, paused: bool) -> None:
        """Note that a clock sample has arrived."""
        self._last_sample, self._ever = time.monotonic(), True
        self._heartbeat.state = "paused" if paused else "running"
        self._heartbeat.detail = ""

    def check(self) -> None:
        """Update the state and log a missing clock; called when no sample has arrived."""
        if self._heartbeat.state == "paused":
            return
        silence = time.monotonic() - self._last_sample
        if silence > SILENCE_S:
            self._heartbeat.state, self._heartbeat.detail = "waiting", "no clock"
        if silence > self._patience and not self._ever and not self._logged:
            self._logged = True
            self._log.warn(f"no clock for {silence:.1f} s: {_likely_cause(self._transport)}{self._hint}")


def _likely_cause(transport: Transport) -> str:
    """Return the likely cause of a missing clock: the fleet is starting, runs on another port, or does not run."""
    if transport.tokens(token_pattern("node", SUPERVISOR)):
        return "the fleet is still starting, or its simulation has ended: ./elea ps shows its processes"
    there = running_fleets()
    if not there:
        return "is the simulation running? No fleet of yours runs on this machine; ./elea up starts one"
    return (
        "is the simulation running, on this node's port and in its domain? Fleets that run here: "
        f"{describe_fleets(there)}; ./elea run --port joins one of them"
    )


class ClockSource:
    """Chooses the publisher whose ``/clock`` a loop follows; samples of others are counted and their sender is logged.

    It is the first one received, until its token disappears or it is silent for CLOCK_SILENCE_S. A node is preferred to
    a publisher without a token, and the simulation to all others, so that all loops choose the same one.
    """

    def __init__(self, node: Node) -> None:
        self._log = node.log
        self._name, self._key = node.identity.resolve(CLOCK.name), node.identity.key(CLOCK.name)
        self._watch = node.transport.watch(token_pattern("pub", name=self._name))
        self._nodes: dict[bytes, str] = {}
        """The node that holds the token of each publisher id."""
        self._source: bytes | None = None
        self._last_sample = -math.inf
        self.counts = RefusalCounter("pacing: " + self._name)

    def follows(self, publisher: bytes) -> bool:
        """Return whether to follow the publisher (empty if foreign) of a sample that has just arrived."""
        now = time.monotonic()
        if publisher != self._source:
            self._update_nodes()
            silent = now - self._last_sample > CLOCK_SILENCE_S
            if self._source is not None and not silent and self._rank(publisher) <= self._rank(self._source):
                self.counts.reject(
                    f"{self._label(publisher)} publishes a different time from {self._label(self._source)}"
                )
                self._log.warn(f"a second {self._name} is ignored: {self.counts.reason}", every=30.0)
                return False
            self._source = publisher
        self._last_sample = now
        self.counts.received += 1
        return True

    def _update_nodes(self) -> None:
        for token in iter(self._watch.poll, None):
            entity = Entity.parse(token.key)
            if entity is None or entity.name != self._name:
                continue
            publisher = publisher_id(entity.node, entity.session, self._key)
            if token.alive:
                self._nodes[publisher] = entity.node
            elif self._nodes.pop(publisher, None) is not None and publisher == self._source:
                self._last_sample = -math.inf

    def _rank(self, publisher: bytes) -> int:
        node = self._nodes.get(publisher)
        return 0 if node is None else 2 if node == SIMULATION else 1

    def _label(self, publisher: bytes) -> str:
        return self._nodes.get(publisher) or "a publisher without a token"


class ClockPacer:
    """Ticks when ``/clock`` reaches a multiple of the period; missed ticks are not repeated."""

    watermarks: Watermarks | None = None

    def __init__(self, node: Node, period_ns: int) -> None:
        transport = node.transport
        self._key, self._encoding = node.identity.key(CLOCK.name), encoding(Clock.ROS_TYPE)
        self.raw = transport.subscribe(self._key, _CLOCKS)
        self._decode = decoder(Clock)
        self._period_ns = period_ns
        self._node = node
        self._source = ClockSource(node)
        node.refusal_counters.append(self._source.counts)
        self._watchdog = ClockWatchdog(node, node.log)
        self._next = self._jumps = 0
        self._epoch, self._simulation = -1, b""

    def start(self) -> None:
        self._node.declare_stepping(self._period_ns)

    def next(self) -> Instant | None:
        clock, simulation = None, b""
        passed: list[int] = []
        for payload, attachment, source in islice(iter(self.raw.recv, None), _CLOCKS):
            if self.raw.key(source) != self._key or self.raw.encoding(source) not in ("", self._encoding):
                continue
            try:
                newer = self._decode(payload)
            except WrongPayload:
                continue
            origin = unpack_attachment(attachment)
            publisher = origin.publisher if origin is not None else b""
            if self._source.follows(publisher):
                passed += [] if clock is None else [clock.clock.ns]
                clock, simulation = newer, publisher
        if clock is None:
            self._watchdog.check()
            return None
        self._watchdog.note_sample(clock.paused)
        now = clock.clock.ns
        restarted = clock.epoch != self._epoch or simulation != self._simulation
        if not restarted:
            self._node.heartbeat.missed += self._missed(passed, now)
        if restarted or now < self._next - self._period_ns:
            self._epoch, self._simulation = clock.epoch, simulation
            self._next, self._jumps = now, self._jumps + 1
        if now < self._next:
            return None
        self._next = now - now % self._period_ns + self._period_ns
        return Instant(now, clock.epoch, str(self._jumps))

    def _missed(self, passed: list[int], now: int) -> int:
        """Count the ticks missed because the clocks at ``passed`` [ns] were skipped for the newest one at ``now``."""
        missed, due = 0, self._next
        for time_ns in passed:
            if time_ns >= due:
                missed, due = missed + 1, time_ns - time_ns % self._period_ns + self._period_ns
        return missed - 1 if missed and now < due else missed

    def finish(self) -> None:
        pass

    def close(self) -> None:
        pass


class LockstepPacer:
    """Ticks when the simulation grants a step.

    With ``reports_reads``, the loop reports topics that it subscribes to between ticks: it gets their messages from the
    next tick on, the same in every run, whenever the subscription reached their publishers.
    """

    def __init__(self, node: SteppingNode, period_ns: int, reports_reads: bool = False) -> None:
        self._node, self._reports_reads = node, reports_reads
        self._version = -1
        self._read: frozenset[str] = frozenset()
        self._latched: frozenset[bytes] = frozenset()
        self.roster: tuple[str, ...] = ()
        self._member = LockstepMember(node.transport, node.names, period_ns)
        node.refusal_counters.append(self._member.refusals)
        self.raw = self._member.raw
        self.watermarks: Watermarks | None = self._member.watermarks
        self._watchdog = ClockWatchdog(node, node.log)
        self._joining: StepGrant | None = None
        self._join_sent = False
        self._deadline = self._looked = 0.0
        self._step: StepGrant | None = None
        self._granted: StepGrant | None = None
        """A step that waits for subscriptions of other members to arrive."""
        self._granted_at = 0.0

    def start(self) -> None:
        self._member.join()

    def next(self) -> Instant | None:
        refused = self._member.refusals.refused
        go = self._member.poll() if self._granted is None else self._granted
        if self._member.refusals.refused != refused:
            self._node.log.warn(f"a Go is refused: {self._member.refusals.reason}", every=10.0)
        if go is None:
            self._link()
            self._watchdog.check()
            return None
        if go.roster:
            self._joined(go)
            return None
        self._watchdog.note_sample(go.paused)
        if go.paused:
            return None
        if go.readers and not self._reaches(go):
            return None
        self._step = go
        # The simulation waits for commands and Done; all other samples of the step are sent after them, in one burst.
        self._node.send_buffer.begin()
        return Instant(go.time, go.epoch, go.simulation)

    def _reaches(self, go: StepGrant) -> bool:
        """Return whether the new subscriptions of other members have arrived, so that the step may begin.

        They arrive within milliseconds: this waits for them for POLL_S, then the loop continues in between.
        """
        if self._granted is None:
            self._granted, self._granted_at = go, time.monotonic()
        until = time.monotonic() + POLL_S
        arrived = self._node.transport.arrived_tokens
        while (missing := _missing_readers(go, arrived)) and time.monotonic() < until:
            time.sleep(POLL_S / 20)
        if missing:
            with suppress(TryAgain):  # those that have ended again will not arrive
                missing -= _missing_readers(go, self._node.transport.all_tokens)
        if missing and time.monotonic() - self._granted_at < LINK_S:
            return False
        if missing:
            listed = ", ".join(sorted({key for key, _ in missing}))[:500]
            self._node.log.warn(
                f"timed out after {LINK_S:g} s waiting for new subscriptions to {listed}; continuing without",
                every=10.0,
            )
        self._granted = None
        return True

    def finish(self, leaving: bool = False, left: tuple[str, ...] = (), idle_until: int = 0) -> None:
        """Report the tick's work as done.

        Args:
            leaving: Whether it was the last tick of the member.
            left: The nodes of the member for which it was the last tick.
            idle_until: Simulation time [ns] before which no step is needed unless messages arrive.
        """
        assert self._step is not None
        reads, latches = self._changes()
        numbers = sequence_numbers(self._node.publishers)
        self._member.finish(self._step.tick, numbers, {}, reads, latches, leaving, left, idle_until)
        self._node.send_buffer.flush()

    def close(self) -> None:
        self._node.send_buffer.flush()
        self._member.close()

    def _changes(self) -> tuple[tuple[str, ...], tuple[bytes, ...]]:
        """Return the keys read and the publishers of latched topics that are new since the last call."""
        node = self._node
        if node.version == self._version:
            return (), ()
        self._version = node.version
        read = frozenset(each.key for each in node.subscribers)
        latched = frozenset(each.publisher for each in node.publishers if each.topic.quality is Quality.LATCHED)
        reads, latches = sorted(read - self._read), sorted(latched - self._latched)
        self._read, self._latched = read, latched
        return tuple(reads) if self._reports_reads else (), tuple(latches)

    def _joined(self, join: StepGrant) -> None:
        """Answer a join at once if all peers are visible, else once they are; a newer join replaces a waiting one."""
        if self._joining is not None and self._joining.simulation != join.simulation:
            self._link()
        self._watchdog.note_sample(join.paused)
        if self._joining is None:
            self._deadline = time.monotonic() + LINK_S
        self._joining, self._looked = join, 0.0
        self._link()

    def _link(self) -> None:
        """Answer the join once all peers are visible, or after LINK_S in any case."""
        now = time.monotonic()
        if self._joining is None or now - self._looked < PEER_CHECK_S:
            return
        self._looked = now
        if absent := self._member.absent(self._joining.roster):
            if now < self._deadline:
                return
            listed = ", ".join(absent)[:500]
            self._node.log.warn(
                f"timed out after {LINK_S:g} s waiting to discover {listed}; continuing without", every=10.0
            )
        join, self._joining = self._joining, None
        self.roster = join.roster
        self._changes()
        if not self._join_sent:
            self._join_sent = True
            sequence_numbers(self._node.publishers)
        self._member.send_join(join, *last_reported(self._node.publishers), tuple(self._latched))


def _missing_readers(go: StepGrant, tokens: Callable[[str], Collection[str]]) -> set[tuple[str, str]]:
    """Return the keys and sessions of the new subscriptions that are not among the ``tokens`` of a pattern."""
    missing: set[tuple[str, str]] = set()
    for key, sessions in go.readers.items():
        found = map(Entity.parse, tokens(token_pattern("sub", name=f"/{key}")))
        there = {each.session for each in found if each is not None}
        missing.update((key, session) for session in sessions if session not in there)
    return missing
