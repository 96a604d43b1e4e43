"""A member's side of lockstep."""

from __future__ import annotations

import hashlib
import secrets
from collections import Counter
from collections.abc import Iterable
from itertools import islice

from messages.base import WrongPayload, encode
from messages.names import BadName
from messages.names import key as key_of
from messages.topics import Quality
from services.runtime.counts import Counts
from services.runtime.graph import Entity, pattern
from services.runtime.lockstep.marks import LARGEST_JUMP, Marks, Numbers
from services.runtime.lockstep.protocol import (
    CAPACITY,
    ENCODING,
    LARGEST,
    SIMULATION,
    TOKEN_BYTES,
    Done,
    Go,
    done_key,
    go_key,
    read_go,
)
from services.runtime.network.transport import Inlet, Outlet, Token, Transport
from services.runtime.roster import missing

LINK_S = 10.0
"""Wall time that a member may take to see its fellows before it goes on without them."""
_MOST_CLAIMS = 8
"""Sessions that are answered as a simulation; one holds the name, others can only be about to go or to come."""
_EARLY = 4
"""Greetings that wait for the token of their sender to come in sight."""


class Follower:
    """Takes Go, answers Done.

    A greeting counts only from a session that holds the node ``/sim``; a Go only from the simulation that is followed,
    with the nonce that this member told it, and never with an older epoch or tick than the last. The simulation changes
    only when the node token of the one before is gone. ``counts`` holds what was refused.
    """

    def __init__(self, transport: Transport, node: str, period_ns: int) -> None:
        self._transport, self._node, self._period_ns = transport, node, period_ns
        self._key = go_key(transport.session)
        self.inlet: Inlet = transport.subscribe(self._key, CAPACITY)
        self.marks = Marks()
        self.counts = Counts("lockstep: Go")
        self._watch = transport.watch(pattern("node", SIMULATION))
        self._claims: Counter[str] = Counter()
        """The sessions that hold the name of the simulation, by their tokens."""
        self._early: dict[str, Go] = {}
        self._secret = secrets.token_bytes(16)
        self._outlets: dict[str, Outlet] = {}
        self._simulation, self._nonce = "", b""
        self._last = -1, -1
        self._go: Go | None = None
        self._done: Done | None = None
        self._token: Token | None = None

    def join(self) -> None:
        """Show readiness; every input is declared by now, so whoever sees this token reaches them."""
        entity = Entity(self._transport.session, "step", self._node, detail=str(self._period_ns))
        self._token = self._transport.token(entity.key)

    def take(self) -> Go | None:
        """The next Go or greeting, if one is there; what a stranger sent in its place is counted and dropped."""
        self._look()
        for session, greeting in self._early.items():
            if session in self._claims:
                del self._early[session]
                return greeting
        for payload, _, source in islice(iter(self.inlet.take, None), CAPACITY):
            if self.inlet.key(source) != self._key or len(payload) > LARGEST:
                self.counts.refuse("sent to many keys at once, or too large")
                continue
            try:
                go = read_go(payload)
            except WrongPayload as error:
                self.counts.refuse(str(error))
                continue
            if (taken := self._greeted(go) if go.roster else self._led(go)) is not None:
                self.counts.received += 1
                return taken
        return None

    def absent(self, roster: Iterable[str]) -> list[str]:
        """The fellows that are not in sight; a put reaches whoever's token is seen."""
        return missing(self._transport, roster)

    def finish(self, tick: int, marks: Numbers, known: Numbers) -> None:
        """Report the step as taken."""
        assert self._go is not None
        self._done = Done(
            session=self._transport.session,
            tick=tick,
            marks=marks,
            known=known,
            epoch=self._go.epoch,
            token=self._go.token,
        )
        self._tell(self._go.simulation, self._done)

    def greet(self, greeting: Go, marks: Numbers, known: Numbers) -> None:
        """Answer a greeting; one that comes again, as the answer was lost, is answered again."""
        session = greeting.simulation
        done = Done(
            session=self._transport.session,
            tick=greeting.tick,
            marks=marks,
            known=known,
            greets=True,
            token=greeting.token,
            nonce=self._nonce_for(session),
            period=self._period_ns,
        )
        self._tell(session, done)

    def leave(self) -> None:
        """Tell the simulation not to wait any more."""
        if self._go is not None and self._transport.open:
            done = Done(session=self._transport.session, tick=-1, leaving=True, token=self._go.token)
            self._tell(self._go.simulation, done)

    def _look(self) -> None:
        """Follow who holds the name of the simulation."""
        for token in iter(self._watch.take, None):
            entity = Entity.parse(token.key)
            if entity is None or entity.node != SIMULATION:
                continue
            self._claims[entity.session] += 1 if token.alive else -1
            if self._claims[entity.session] > 0:
                continue
            del self._claims[entity.session]
            self._early.pop(entity.session, None)
            if entity.session != self._simulation and (outlet := self._outlets.pop(entity.session, None)) is not None:
                outlet.close()

    def _greeted(self, go: Go) -> Go | None:
        """A greeting, if its sender may lead this member. It proves nothing yet, so nothing else of it is believed."""
        session = go.simulation
        if session != self._simulation and self._simulation in self._claims:
            self.counts.refuse(f"greeted by {session}; the simulation is {self._simulation}")
        elif self._node not in go.roster or not _names(go.roster):
            self.counts.refuse("greeted with a roster without this node, or with what are no names")
        elif session not in self._claims:
            # Its token may come in sight a moment later: then it counts.
            self._early[session] = go
            if len(self._early) > _EARLY:
                del self._early[next(iter(self._early))]
                self.counts.refuse(f"greeted by {session}, which holds no token of {SIMULATION}")
        elif session not in self._outlets and len(self._outlets) >= _MOST_CLAIMS:
            self.counts.refuse(f"more than {_MOST_CLAIMS} sessions call themselves {SIMULATION}")
        else:
            return go
        return None

    def _led(self, go: Go) -> Go | None:
        """A Go that is no greeting, if it comes from the simulation and is newer than the last."""
        if fault := self._fault(go):
            self.counts.refuse(fault)
            return None
        if go.simulation != self._simulation:
            self._change(go.simulation)
        if go.paused:
            return go
        here = go.epoch, go.tick
        if here == self._last:
            # The simulation asks again: its Go came twice, or the answer was lost.
            if self._done is not None:
                self._tell(go.simulation, self._done)
            return None
        self.marks.renewed = go.epoch > self._last[0] >= 0
        self._go, self._last, self._done = go, here, None
        if go.members:
            self.marks.regroup(set(go.members))
        self.marks.advance(go.marks, go.known)
        return go

    def _change(self, simulation: str) -> None:
        """Follow another simulation, whose time stands where it likes."""
        if (former := self._outlets.pop(self._simulation, None)) is not None:
            former.close()
        self._simulation, self._nonce = simulation, self._nonce_for(simulation)
        self._last, self._done = (-1, -1), None

    def _fault(self, go: Go) -> str:
        """Why a Go is not obeyed; empty when it is."""
        if go.simulation != self._simulation:
            if self._simulation in self._claims:
                return f"from {go.simulation}; the simulation is {self._simulation}"
            if go.simulation not in self._outlets or go.simulation not in self._claims:
                return f"from {go.simulation}, which is not the simulation"
            if go.nonce != self._nonce_for(go.simulation):
                return "without the nonce that this node told the simulation: it is forged"
            return ""
        if go.nonce != self._nonce:
            return "without the nonce that this node told the simulation: it is forged"
        epoch, tick = self._last
        if (go.epoch, go.tick) < self._last:
            return f"tick {go.tick} of epoch {go.epoch} after tick {tick} of epoch {epoch}"
        if epoch >= 0 and (go.epoch - epoch > LARGEST_JUMP or (go.epoch == epoch and go.tick - tick > LARGEST_JUMP)):
            return f"tick {go.tick} of epoch {go.epoch} after tick {tick} of epoch {epoch}: too far"
        return self.marks.implausible(go.marks)

    def _nonce_for(self, session: str) -> bytes:
        """What this member tells one simulation alone."""
        return hashlib.blake2b(session.encode(), key=self._secret, digest_size=TOKEN_BYTES).digest()

    def _tell(self, simulation: str, done: Done) -> None:
        outlet = self._outlets.get(simulation)
        if outlet is None:
            outlet = self._transport.publish(done_key(simulation), ENCODING, Quality.EVENT)
            self._outlets[simulation] = outlet
        outlet.put(encode(done), attachment=b"")


def _names(roster: Iterable[str]) -> bool:
    try:
        for name in roster:
            key_of(name)
    except BadName:
        return False
    return True
