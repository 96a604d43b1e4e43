"""The simulation's side of lockstep."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import Any

import msgspec

from messages.base import WrongPayload, encode
from messages.names import key as key_of
from messages.topics import Quality
from services.runtime.graph import Entity, pattern
from services.runtime.lockstep.marks import Marks, Numbers
from services.runtime.lockstep.member import Member
from services.runtime.lockstep.protocol import CAPACITY, ENCODING, Done, Go, done_key, go_key, numbers, read_done
from services.runtime.log import Log
from services.runtime.network.transport import Inlet, Transport
from services.runtime.network.wire import member_id
from services.runtime.outbox import Outbox
from services.runtime.outputs import Output

AGAIN_S = 2.0
"""Wall time after which what was not seen or not answered at the start is looked for, and asked, again."""


class Barrier:
    """Waits for members.

    ``idle`` is called with the inlet to wait on whenever it has to wait; ``now`` tells where the simulation stands.
    """

    def __init__(
        self,
        transport: Transport,
        outbox: Outbox,
        roster: tuple[str, ...],
        log: Log,
        idle: Callable[[Inlet], None],
        now: Callable[[], Go],
    ) -> None:
        self.marks = Marks()
        self.dropped: list[str] = []
        self._transport, self._outbox, self._roster = transport, outbox, roster
        self._log, self._idle, self._now = log, idle, now
        self._inlet = transport.subscribe(done_key(transport.session), CAPACITY)
        self._reads_watch = transport.watch(pattern("sub"))
        self._watch = transport.watch(pattern("step"))
        self._readers: dict[str, set[str]] = {}
        """The sessions that read a key."""
        self._members: dict[str, Member] = {}
        self._pending: dict[str, int] = {}
        self._generation = 0
        self._stride = 1

    def gather(self) -> None:
        """Block until the whole roster has joined and every member sees every other."""
        started = reported = looked = time.monotonic()
        while True:
            if (now := time.monotonic()) - looked > AGAIN_S:
                looked = now
                for watch in (self._watch, self._reads_watch):
                    watch.look()
            self.update()
            active = {member.node for member in self._members.values() if member.active}
            missing = [node for node in self._roster if node not in active]
            if not missing:
                return
            if now - reported > 5.0:
                reported = now
                self._log.warn(f"waiting for {', '.join(missing)} since {now - started:.0f} s: did they start?")
            self._idle(self._inlet)

    def update(self) -> None:
        """Follow who joined, who left, and who answered.

        Tokens are looked at before answers are taken: whoever took leave before its token went is then heard.
        """
        tokens = list(iter(self._watch.take, None))
        self._receive()
        while (event := self._reads_watch.take()) is not None:
            entity = Entity.parse(event.key)
            if entity is not None:
                readers = self._readers.setdefault(key_of(entity.name), set())
                (readers.add if event.alive else readers.discard)(entity.session)
        for token in tokens:
            entity = Entity.parse(token.key)
            if entity is None:
                continue
            if not token.alive:
                if self._drop(entity.session):
                    self.marks.died.add(member_id(entity.node, entity.session))
                    self.dropped.append(entity.node)
                    self._log.warn(f"{entity.node} is gone: the others go on without it")
            elif entity.node in self._roster and entity.session not in self._members:
                self._add(entity)
        for member in list(self._members.values()):
            if not member.active and self._all_here():
                self._greet(member)

    def due(self, time_ns: int) -> bool:
        """Whether any member steps at this time."""
        return time_ns % self._stride == 0 and any(
            member.active and time_ns % member.period_ns == 0 for member in self._members.values()
        )

    def release(self, go: Go, outputs: Iterable[Output[Any]]) -> None:
        """Let the members that are due at ``go.time`` take their step."""
        self._spread(numbers(outputs), "marks")
        for session, member in self._members.items():
            if member.active and go.time % member.period_ns == 0:
                self._pending[session] = go.tick
                self._tell(member, go)

    def collect(self, time_ns: int) -> None:
        """Block until those that are due at this time have finished their last step, or died.

        What they sent is then in ``marks``. Answers of others wait for their time: when they came makes no difference.
        """
        self._receive()
        while due := [session for session in self._pending if time_ns % self._members[session].period_ns == 0]:
            late = False
            for session in due:
                if (answer := self._members[session].answer) is None:
                    late = True
                else:
                    del self._pending[session]
                    self._members[session].answer = None
                    self._hear(answer)
            if late:
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
        begun = any(member.active for member in self._members.values())
        return bool(self._generation) and (begun or set(self._roster) <= set(self._present()))

    def _greet(self, member: Member) -> None:
        """Greet a member, and again while it does not answer: either may be lost while links come up."""
        if not member.greeting:
            member.greeting = self._tell(member, msgspec.structs.replace(self._now(), roster=self._present()))
        elif time.monotonic() - member.greeted_at > AGAIN_S:
            self._outbox.put(member.outlet.put, member.greeting, b"")
        else:
            return
        member.greeted_at = time.monotonic()

    def _add(self, entity: Entity) -> None:
        self._generation += 1
        outlet = self._transport.publish(go_key(entity.session), ENCODING, Quality.EVENT)
        self._members[entity.session] = Member(
            entity.node, member_id(entity.node, entity.session), int(entity.detail), outlet
        )
        self._count()

    def _drop(self, session: str) -> bool:
        """Wait for this member no more; whether it was one."""
        member = self._members.pop(session, None)
        if member is None:
            return False
        self._generation += 1
        self._pending.pop(session, None)
        self._count()
        self._outbox.release()
        member.outlet.close()
        return True

    def _count(self) -> None:
        """Members came or went. All their steps fall on multiples of the stride."""
        self.marks.members = {member.id for member in self._members.values()}
        self._stride = math.gcd(*(member.period_ns for member in self._members.values())) or 1

    def _tell(self, member: Member, go: Go) -> bytes:
        """Send what is new for the member with a Go; what was sent."""
        members: tuple[bytes, ...] = ()
        if member.told != self._generation:
            member.told = self._generation
            own = next(s for s, m in self._members.items() if m is member)
            members = (*(m.id for s, m in self._members.items() if s != own), self._own_id)
        marks, known, member.marks, member.known = member.marks, member.known, {}, {}
        leave = msgspec.structs.replace(go, members=members, marks=marks, known=known)
        payload = encode(leave)
        self._outbox.put(member.outlet.put, payload, b"")
        return payload

    @property
    def _own_id(self) -> bytes:
        return member_id("/sim", self._transport.session)

    def _receive(self) -> None:
        while (sample := self._inlet.take()) is not None:
            try:
                done = read_done(sample[0])
            except WrongPayload:
                continue
            member = self._members.get(done.session)
            if member is None:
                continue
            if done.leaving:
                self._drop(done.session)
                self._log.info(f"{member.node} has finished")
                continue
            if not done.greets:
                if self._pending.get(done.session) == done.tick:
                    member.answer = done
            elif not member.active:
                member.active = True
                self._hear(done)

    def _hear(self, done: Done) -> None:
        """Let through what a member says it has sent."""
        self._spread(done.marks, "marks", done.session)
        self._spread(done.known, "known", done.session)
        self.marks.advance(done.marks, done.known)

    def _spread(self, news: Numbers, kind: str, sender: str = "") -> None:
        """Keep the numbers for every member that reads the key."""
        for key, reached in news.items():
            for session in self._readers.get(key, ()):
                if session != sender and (member := self._members.get(session)) is not None:
                    kept: Numbers = getattr(member, kind)
                    kept.setdefault(key, {}).update(reached)
