"""The member's side of lockstep, for a process with one node or several."""

from __future__ import annotations

import hashlib
import secrets
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import islice

from messages.base import WrongPayload, encode
from messages.names import BadName
from messages.names import key as key_of
from messages.topics import Quality
from services.runtime.discovery import missing_nodes
from services.runtime.graph import Entity, token_pattern
from services.runtime.lockstep.protocol import (
    ENCODING,
    MAX_BYTES,
    QUEUE_SIZE,
    SIMULATION,
    TOKEN_BYTES,
    StepGrant,
    StepReport,
    decode_grant,
    grant_key,
    report_key,
)
from services.runtime.lockstep.watermarks import MAX_JUMP, Numbers, Watermarks
from services.runtime.transport.api import RawPublisher, RawSubscriber, Token, Transport
from services.runtime.transport.sequences import RefusalCounter
from services.runtime.transport.wire import member_id

LINK_S = 30.0
"""Wall time [s] that a member waits to discover its peers before it continues without them."""
_MAX_CANDIDATES = 8
"""Maximum sessions answered as a simulation: one holds the name, others may be about to end or to take over."""
_EARLY = 4
"""Maximum join messages that wait for their sender's token to appear."""


class LockstepMember:
    """The member's side of lockstep: receives Go, answers Done.

    A join is accepted only from a session that holds the node ``/sim``; a Go only from the current simulation, with the
    nonce that this member sent it, and never with an older epoch or tick than the last. The member switches to another
    simulation only once the node token of the last one is gone. ``refusals`` counts refused messages.

    Several ``nodes`` form one member. What they send each other in a tick, they receive in the next, as from others.
    """

    def __init__(self, transport: Transport, nodes: Sequence[str], period_ns: int) -> None:
        self._transport, self._nodes, self._period_ns = transport, nodes, period_ns
        self._own = {member_id(node, transport.session) for node in nodes} if len(nodes) > 1 else set[bytes]()
        """The ids of its nodes, whose samples for each other wait for the next tick; empty for a single node."""
        self._left: tuple[str, ...] = ()
        self._sent: list[tuple[Numbers, Numbers]] = []
        """The numbers reported since the last Go, to admit samples between its own nodes."""
        self._key = grant_key(transport.session)
        self.raw: RawSubscriber = transport.subscribe(self._key, QUEUE_SIZE)
        self.watermarks = Watermarks()
        self.refusals = RefusalCounter("lockstep: Go")
        self._watch = transport.watch(token_pattern("node", SIMULATION))
        self._candidates: Counter[str] = Counter()
        """The number of tokens of each session that holds the simulation's name."""
        self._early: dict[str, StepGrant] = {}
        self._secret = secrets.token_bytes(16)
        self._publishers: dict[str, RawPublisher] = {}
        self._simulation, self._nonce = "", b""
        self._last = -1, -1
        self._go: StepGrant | None = None
        self._done: StepReport | None = None
        self._tokens: list[Token] = []

    def join(self) -> None:
        """Declare readiness, after all subscriptions: a node that sees this token can reach them."""
        former, sharing = self._tokens, str(len(self._nodes)) if len(self._nodes) > 1 else "-"
        session, period = self._transport.session, str(self._period_ns)
        steps = [Entity(session, "step", node, record=sharing, detail=period) for node in self._nodes]
        self._tokens = [self._transport.declare_token(each.key) for each in steps]
        for token in former:
            token.close()

    def poll(self) -> StepGrant | None:
        """Return the next Go or join, or None; messages of other senders are counted and dropped."""
        self._watch_simulations()
        for session, join in self._early.items():
            if session in self._candidates:
                del self._early[session]
                return join
        for payload, _, source in islice(iter(self.raw.recv, None), QUEUE_SIZE):
            if self.raw.key(source) != self._key or len(payload) > MAX_BYTES:
                self.refusals.reject("sent to many keys at once, or too large")
                continue
            try:
                go = decode_grant(payload)
            except WrongPayload as error:
                self.refusals.reject(str(error))
                continue
            if (taken := self._joined(go) if go.roster else self._follows(go)) is not None:
                self.refusals.received += 1
                return taken
        return None

    def absent(self, roster: Iterable[str]) -> list[str]:
        """Return the peers that are not visible; a put reaches every node whose token is visible."""
        return missing_nodes(self._transport, roster)

    def finish(
        self,
        tick: int,
        sequence_numbers: Numbers,
        announced: Numbers,
        reads: tuple[str, ...] = (),
        latches: tuple[bytes, ...] = (),
        leaving: bool = False,
        left: tuple[str, ...] = (),
        idle_until: int = 0,
    ) -> None:
        """Report the step as finished, with the keys subscribed to (``reads``) and the publishers of latched topics
        added (``latches``) since the last one; the other arguments are those of ``StepReport``."""
        assert self._go is not None
        self._done = StepReport(
            session=self._transport.session,
            tick=tick,
            sequence_numbers=sequence_numbers,
            announced=announced,
            epoch=self._go.epoch,
            token=self._go.token,
            reads=reads,
            latches=latches,
            leaving=leaving,
            left=left,
            idle_until=idle_until,
        )
        self._note_sent(sequence_numbers, announced)
        self._left += left
        self._report(self._go.simulation, self._done)

    def send_join(
        self, join: StepGrant, sequence_numbers: Numbers, announced: Numbers, latches: tuple[bytes, ...] = ()
    ) -> None:
        """Answer a join; a repeated one, after a lost answer, is answered again."""
        session = join.simulation
        done = StepReport(
            session=self._transport.session,
            tick=join.tick,
            sequence_numbers=sequence_numbers,
            announced=announced,
            answers_join=True,
            token=join.token,
            nonce=self._nonce_for(session),
            period=self._period_ns,
            latches=latches,
        )
        self._note_sent(sequence_numbers, announced)
        self._report(session, done)

    def close(self) -> None:
        """Report to the simulation that this member is leaving."""
        if self._go is not None and self._transport.open:
            done = StepReport(session=self._transport.session, tick=-1, leaving=True, token=self._go.token)
            self._report(self._go.simulation, done)

    def _watch_simulations(self) -> None:
        """Update from the tokens of the simulation's name."""
        for token in iter(self._watch.poll, None):
            entity = Entity.parse(token.key)
            if entity is None or entity.node != SIMULATION:
                continue
            self._candidates[entity.session] += 1 if token.alive else -1
            if self._candidates[entity.session] > 0:
                continue
            del self._candidates[entity.session]
            self._early.pop(entity.session, None)
            if (
                entity.session != self._simulation
                and (publisher := self._publishers.pop(entity.session, None)) is not None
            ):
                publisher.close()

    def _joined(self, go: StepGrant) -> StepGrant | None:
        """Return a join if its sender may lead this member. It is not yet proven, so no other content is used."""
        session = go.simulation
        if session != self._simulation and self._simulation in self._candidates:
            self.refusals.reject(f"a join from {session}; the simulation is {self._simulation}")
        elif not set(self._nodes) <= set(go.roster) or not _names(go.roster):
            self.refusals.reject("a join whose roster lacks this node or contains invalid names")
        elif session not in self._candidates:
            # Its token may appear a moment later: then the join is accepted.
            self._early[session] = go
            if len(self._early) > _EARLY:
                del self._early[next(iter(self._early))]
                self.refusals.reject(f"a join from {session}, which holds no token of {SIMULATION}")
        elif session not in self._publishers and len(self._publishers) >= _MAX_CANDIDATES:
            self.refusals.reject(f"more than {_MAX_CANDIDATES} sessions call themselves {SIMULATION}")
        else:
            return go
        return None

    def _follows(self, go: StepGrant) -> StepGrant | None:
        """Return a Go if it comes from the simulation and is newer than the last; answer a repeated one again."""
        if fault := self._fault(go):
            self.refusals.reject(fault)
            return None
        if go.simulation != self._simulation:
            self._change(go.simulation)
        if go.paused:
            return go
        here = go.epoch, go.tick
        if here == self._last:
            # The simulation repeats its Go: the first one or its answer was slow or lost.
            if self._done is not None:
                self._report(go.simulation, self._done)
            return None
        self.watermarks.epoch_changed = go.epoch > self._last[0] >= 0
        self._go, self._last, self._done = go, here, None
        if go.members:
            self.watermarks.regroup({*go.members, *self._own})
        self.watermarks.advance(go.sequence_numbers, go.announced)
        for sent in self._sent:
            self.watermarks.advance(*sent)
        self._sent.clear()
        if self._left:  # the simulation knows it: their tokens may go, and a later simulation expects only the others
            self._nodes = [node for node in self._nodes if node not in self._left]
            self._left = ()
            self.join()
        self.watermarks.skipped.update(go.skipped)
        return go

    def _change(self, simulation: str) -> None:
        """Switch to another simulation, which may be at any time."""
        if (former := self._publishers.pop(self._simulation, None)) is not None:
            former.close()
        self._simulation, self._nonce = simulation, self._nonce_for(simulation)
        self._last, self._done = (-1, -1), None

    def _fault(self, go: StepGrant) -> str:
        """Return why a Go is refused; empty if it is accepted."""
        if go.simulation != self._simulation:
            if self._simulation in self._candidates:
                return f"from {go.simulation}; the simulation is {self._simulation}"
            if go.simulation not in self._publishers or go.simulation not in self._candidates:
                return f"from {go.simulation}, which is not the simulation"
            if go.nonce != self._nonce_for(go.simulation):
                return "without the nonce that this node sent to the simulation: it is forged"
            return ""
        if go.nonce != self._nonce:
            return "without the nonce that this node sent to the simulation: it is forged"
        epoch, tick = self._last
        if (go.epoch, go.tick) < self._last:
            return f"tick {go.tick} of epoch {go.epoch} after tick {tick} of epoch {epoch}"
        if epoch >= 0 and (go.epoch - epoch > MAX_JUMP or (go.epoch == epoch and go.tick - tick > MAX_JUMP)):
            return f"tick {go.tick} of epoch {go.epoch} after tick {tick} of epoch {epoch}: too far"
        return self.watermarks.implausible(go.sequence_numbers)

    def _note_sent(self, sequence_numbers: Numbers, announced: Numbers) -> None:
        if self._own:
            self._sent.append((sequence_numbers, announced))

    def _nonce_for(self, session: str) -> bytes:
        """Return this member's nonce for one simulation: a keyed hash of its session."""
        return hashlib.blake2b(session.encode(), key=self._secret, digest_size=TOKEN_BYTES).digest()

    def _report(self, simulation: str, done: StepReport) -> None:
        publisher = self._publishers.get(simulation)
        if publisher is None:
            publisher = self._transport.advertise(report_key(simulation), ENCODING, Quality.EVENT)
            self._publishers[simulation] = publisher
        publisher.put(encode(done), attachment=b"")


def _names(roster: Iterable[str]) -> bool:
    try:
        for name in roster:
            key_of(name)
    except BadName:
        return False
    return True
