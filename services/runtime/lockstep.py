"""Lockstep: the simulation waits at each tick until every member that is due has finished its step.

The simulation sends each due member a Go with the time and the numbers of all samples sent up to the previous tick on
the keys that the member reads; the member waits for exactly these, steps, and answers Done with the numbers of what it
sent. So every member sees the same messages at the same tick, whatever the load or the network's timing, and a member
costs nothing at the ticks at which it is not due.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import msgspec

from messages.base import decoder, encode
from messages.names import key as key_of
from messages.topics import Quality
from services.runtime.graph import ROOT, Entity, pattern
from services.runtime.log import Log
from services.runtime.marks import Marks, Numbers, merge
from services.runtime.outputs import Output
from services.runtime.transport import Inlet, Outlet, Token, Transport
from services.runtime.wire import member_id

_ENCODING = "application/msgpack;elea/lockstep"
_CAPACITY = 256

LINK_S = 10.0
"""Wall time that a member may take to see its fellows before it goes on without them."""


class Go(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """Leave to take one step. With ``roster`` it is a greeting: see these nodes first, answer, take no step."""

    simulation: str
    tick: int
    time: int
    epoch: int
    paused: bool = False
    roster: tuple[str, ...] = ()
    members: tuple[bytes, ...] = ()
    marks: Numbers = {}
    known: Numbers = {}


class Done(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """A step is taken; ``known`` holds what was sent before the fellows were certain to listen."""

    session: str
    tick: int
    marks: Numbers = {}
    known: Numbers = {}


_read_go = decoder(Go)
_read_done = decoder(Done)


def numbers(outputs: Iterable[Output[Any]]) -> Numbers:
    """The last numbers of the outputs that sent anything since the previous call."""
    news: Numbers = {}
    for output in outputs:
        if output.sent != output.marked:
            output.marked = output.sent
            news.setdefault(output.key, {})[output.publisher] = output.sent
    return news


def greeting_numbers(outputs: Iterable[Output[Any]]) -> tuple[Numbers, Numbers]:
    """As ``numbers`` before the first step: what is latched will reach everybody, the rest is only known."""
    each = list(outputs)
    return (
        numbers(o for o in each if o.topic.quality is Quality.LATCHED),
        numbers(o for o in each if o.topic.quality is not Quality.LATCHED),
    )


class Follower:
    """A member's side: takes Go, answers Done."""

    def __init__(self, transport: Transport, node: str, period_ns: int) -> None:
        self._transport, self._node, self._period_ns = transport, node, period_ns
        self.inlet: Inlet = transport.subscribe(f"{ROOT}/{transport.session}/go", _CAPACITY)
        self.marks = Marks()
        self._done: Outlet | None = None
        self._simulation = ""
        self._token: Token | None = None

    def join(self) -> None:
        """Show readiness; every input is declared by now, so whoever sees this token reaches them."""
        entity = Entity(self._transport.session, "step", self._node, detail=str(self._period_ns))
        self._token = self._transport.token(entity.key)

    def take(self) -> Go | None:
        """The next Go, if one is there."""
        sample = self.inlet.take()
        if sample is None:
            return None
        go = _read_go(sample.payload)
        if go.members:
            self.marks.members = set(go.members)
        self.marks.advance(go.marks, go.known)
        if go.simulation != self._simulation:
            self._simulation = go.simulation
            self._done = self._transport.publish(f"{ROOT}/{go.simulation}/done", _ENCODING, Quality.EVENT)
        return go

    def linked(self, roster: Iterable[str]) -> bool:
        """Whether all fellows are in sight; a put reaches whoever's token is seen."""
        seen = {entity.node for key in self._transport.tokens(pattern("step")) if (entity := Entity.parse(key))}
        return set(roster) <= seen

    def finish(self, tick: int, marks: Numbers, known: Numbers) -> None:
        """Report the step as taken."""
        assert self._done is not None
        self._done.put(encode(Done(session=self._transport.session, tick=tick, marks=marks, known=known)), b"")


@dataclass
class _Member:
    """What the simulation knows of one member."""

    node: str
    id: bytes
    period_ns: int
    outlet: Outlet
    reads: set[str] = field(default_factory=set)
    greeted: bool = False
    active: bool = False
    told: int = -1
    marks: Numbers = field(default_factory=dict)
    known: Numbers = field(default_factory=dict)


class Barrier:
    """The simulation's side.

    ``idle`` is called with the inlet to wait on whenever it has to wait, ``now`` tells where the simulation stands.
    """

    def __init__(
        self,
        transport: Transport,
        roster: tuple[str, ...],
        log: Log,
        idle: Callable[[Inlet], None],
        now: Callable[[], Go],
    ) -> None:
        self.marks = Marks()
        self.dropped: list[str] = []
        self._transport, self._roster, self._log, self._idle, self._now = transport, roster, log, idle, now
        self._inlet = transport.subscribe(f"{ROOT}/{transport.session}/done", _CAPACITY)
        self._reads_watch = transport.watch(pattern("sub"))
        self._watch = transport.watch(pattern("step"))
        self._reads: dict[str, set[str]] = {}
        self._members: dict[str, _Member] = {}
        self._pending: dict[str, int] = {}
        self._generation = 0

    def gather(self) -> None:
        """Block until the whole roster has joined and every member sees every other."""
        started = reported = time.monotonic()
        while True:
            self.update()
            active = {member.node for member in self._members.values() if member.active}
            missing = [node for node in self._roster if node not in active]
            if not missing:
                return
            if time.monotonic() - reported > 5.0:
                reported = time.monotonic()
                waited = reported - started
                self._log.warn(f"waiting for {', '.join(missing)} since {waited:.0f} s: did they start?")
            self._idle(self._inlet)

    def update(self) -> None:
        """Follow who joined, who left, and who answered."""
        self._receive()
        while (event := self._reads_watch.take()) is not None:
            entity = Entity.parse(event.key)
            if entity is not None:
                reads = self._reads.setdefault(entity.session, set())
                (reads.add if event.alive else reads.discard)(key_of(entity.name))
        while (event := self._watch.take()) is not None:
            entity = Entity.parse(event.key)
            if entity is None or not entity.detail.isdigit():
                continue
            if not event.alive:
                self._drop(entity.session)
            elif entity.node in self._roster:
                self._add(entity)
        for member in list(self._members.values()):
            if not member.greeted and self._all_here():
                member.greeted = True
                self._tell(member, msgspec.structs.replace(self._now(), roster=self._present()))

    def due(self, time_ns: int) -> bool:
        """Whether any member steps at this time."""
        return any(member.active and time_ns % member.period_ns == 0 for member in self._members.values())

    def release(self, go: Go, outputs: Iterable[Output[Any]]) -> None:
        """Let the members that are due at ``go.time`` take their step."""
        self._spread(numbers(outputs), "marks")
        for session, member in self._members.items():
            if member.active and go.time % member.period_ns == 0:
                self._pending[session] = go.tick
                self._tell(member, go)

    def collect(self) -> None:
        """Block until all that were released have finished, or died; what they sent is then in ``marks``."""
        self._receive()
        while self._pending:
            self._idle(self._inlet)
            self.update()

    def announce(self, go: Go) -> None:
        """Tell every member something that is no step: a pause."""
        for member in self._members.values():
            self._tell(member, go)

    def _present(self) -> tuple[str, ...]:
        return tuple(sorted(member.node for member in self._members.values()))

    def _all_here(self) -> bool:
        """Greetings wait for the whole roster at the start; later ones go out at once."""
        return bool(self._generation) and (
            any(member.active for member in self._members.values()) or set(self._roster) <= set(self._present())
        )

    def _add(self, entity: Entity) -> None:
        self._generation += 1
        outlet = self._transport.publish(f"{ROOT}/{entity.session}/go", _ENCODING, Quality.EVENT)
        self._members[entity.session] = _Member(
            entity.node, member_id(entity.node, entity.session), int(entity.detail), outlet
        )
        self.marks.members = {member.id for member in self._members.values()}

    def _drop(self, session: str) -> None:
        member = self._members.pop(session, None)
        if member is None:
            return
        self._generation += 1
        self._pending.pop(session, None)
        self._reads.pop(session, None)
        self.marks.members = {each.id for each in self._members.values()}
        member.outlet.close()
        self.dropped.append(member.node)
        self._log.warn(f"{member.node} is gone: the others go on without it")

    def _tell(self, member: _Member, go: Go) -> None:
        members: tuple[bytes, ...] = ()
        if member.told != self._generation:
            member.told = self._generation
            own = next(s for s, m in self._members.items() if m is member)
            members = (*(m.id for s, m in self._members.items() if s != own), self._own_id)
        marks, known, member.marks, member.known = member.marks, member.known, {}, {}
        member.outlet.put(encode(msgspec.structs.replace(go, members=members, marks=marks, known=known)), b"")

    @property
    def _own_id(self) -> bytes:
        return member_id("/sim", self._transport.session)

    def _receive(self) -> None:
        while (sample := self._inlet.take()) is not None:
            done = _read_done(sample.payload)
            member = self._members.get(done.session)
            if member is None:
                continue
            if not member.active:
                member.active = True
            elif self._pending.get(done.session) == done.tick:
                del self._pending[done.session]
            self._spread(done.marks, "marks", done.session)
            self._spread(done.known, "known", done.session)
            self.marks.advance(done.marks, done.known)

    def _spread(self, news: Numbers, kind: str, sender: str = "") -> None:
        """Keep the numbers for every member that reads the key."""
        for key, reached in news.items():
            for session, member in self._members.items():
                if session != sender and key in self._reads.get(session, ()):
                    merge(getattr(member, kind), {key: reached})
