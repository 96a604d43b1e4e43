"""The simulation's side of lockstep."""

from __future__ import annotations

import math
import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable
from itertools import islice
from typing import Any, TypeVar

import msgspec

from messages.base import WrongPayload, encode
from messages.elea import LockstepState
from messages.names import key as key_of
from messages.topics import HEALTH, Quality
from services.runtime.graph import Entity, token_pattern
from services.runtime.lockstep.member_state import MemberState
from services.runtime.lockstep.protocol import (
    ENCODING,
    MAX_BYTES,
    QUEUE_SIZE,
    SIMULATION,
    TOKEN_BYTES,
    StepGrant,
    StepReport,
    decode_report,
    grant_key,
    report_key,
    sequence_numbers,
)
from services.runtime.lockstep.watermarks import Numbers, Watermarks, merge_numbers
from services.runtime.log import Log
from services.runtime.publisher import Publisher, SendBuffer
from services.runtime.transport.api import RawSubscriber, Transport
from services.runtime.transport.sequences import RefusalCounter
from services.runtime.transport.wire import member_id, publisher_id, unpack_attachment

RETRY_S = 2.0
"""Wall time [s] after which missing tokens are looked for, and unanswered messages sent, again."""
REPORT_S = 5.0
"""Wall time [s] between two log lines that name the awaited members."""
GATHER_S = 120.0
"""Wall time [s] without a new member after which time begins without the missing ones."""
SILENT_S = 30.0
"""Wall time after which a member that neither answers nor beats is given up; a supervisor ends a hung one sooner."""
MAX_WAIT_S = 300.0
"""The same for one that beats: it is slow, and not dead."""
LOOK_S = 0.25
"""Wall time [s] between two requests to late members, of which a flood may have pushed out the first."""
MAX_LOOK_S = 0.5
"""One look counts as this much waiting at most: a machine that is too busy to look has not waited."""
MAX_SESSIONS = 16
"""Sessions that may show readiness in the name of one node; all but one can only be about to go or to come."""
MAX_SUBSCRIPTIONS = 1 << 17
"""Subscriptions of the roster's nodes that are kept."""

_HEALTH_KEY = key_of(HEALTH.name)

C = TypeVar("C")


def _nothing() -> None:
    pass


def _never() -> bool:
    return False


class Barrier:
    """Waits for the members of lockstep at each tick.

    ``idle`` is called with the subscriber to wait on; ``now`` gives the simulation's time and tick. The member of an
    expected node is the session that declares readiness under its name and holds its token. A Done counts only with
    the token that this barrier sent to its member. ``refusals`` counts refused messages.
    """

    def __init__(
        self,
        transport: Transport,
        outbox: SendBuffer,
        roster: tuple[str, ...],
        log: Log,
        idle: Callable[[RawSubscriber], None],
        now: Callable[[], StepGrant],
    ) -> None:
        self.watermarks = Watermarks()
        self.refusals = RefusalCounter("lockstep: Done")
        self._transport, self._outbox, self._roster = transport, outbox, dict.fromkeys(roster)
        self._log, self._idle, self._now = log, idle, now
        self._key = report_key(transport.session)
        self._raw = transport.subscribe(self._key, QUEUE_SIZE)
        self._beats = transport.subscribe(_HEALTH_KEY, QUEUE_SIZE)
        self._reads_watch = transport.watch(token_pattern("sub"))
        self._watch = transport.watch(token_pattern("step"))
        self._nodes_watch = transport.watch(token_pattern("node"))
        # A token that differs in its last chunks says the same, and may come and go beside the true one: all count.
        self._readers: dict[str, Counter[str]] = {}
        """The sessions of the roster's nodes that read a key."""
        self._reads = 0
        self._ready: Counter[tuple[str, str]] = Counter()
        """Nodes of the roster, and the sessions that show readiness in their names."""
        self._holders: Counter[tuple[str, str]] = Counter()
        """Nodes of the roster, and the sessions that hold their names."""
        self._not_before: dict[str, float] = {}
        """Wall time before which a session that left or was given up does not become a member again."""
        self._members: dict[str, MemberState] = {}
        self._gone: deque[MemberState] = deque(maxlen=QUEUE_SIZE)
        """The members whose processes disappeared without leaving, since the last look."""
        self._pending: dict[str, tuple[int, int]] = {}
        self._sent: Numbers = {}
        """The simulation's own samples."""
        self._lost: dict[str, None] = {}
        self._left: dict[str, None] = {}
        self.version = 0
        """Grows whenever ``state`` may have changed."""
        self._begun = False
        self._generation = 0
        self._stride = 1
        self._epoch = -1
        self._absent: frozenset[str] = frozenset()

    @property
    def state(self) -> LockstepState:
        """The members, those lost, and those that left, since time began."""
        return LockstepState(
            members=tuple(sorted(member.node for member in self._members.values() if member.active)),
            lost=tuple(self._lost),
            left=tuple(self._left),
        )

    def wait_for_members(self, absent: Collection[str] = (), meanwhile: Callable[[], None] = _nothing) -> None:
        """Block until the whole roster has joined and every member sees every other.

        After GATHER_S without a new member, time begins without the missing ones, which count as lost.

        Args:
            absent: Nodes not to wait for.
            meanwhile: Called at least ten times a second.
        """
        self._absent = frozenset(absent) & self._roster.keys()
        waited = reported = without = 0.0
        most = 0
        last = looked = time.monotonic()
        while True:
            now = time.monotonic()
            passed = min(now - last, MAX_LOOK_S)
            last, waited, without = now, waited + passed, without + passed
            if now - looked > RETRY_S:
                looked = now
                for watch in (self._nodes_watch, self._watch, self._reads_watch):
                    watch.refresh()
            self.update()
            active = {member.node for member in self._members.values() if member.active}
            missing = [node for node in self._roster if node not in active | self._absent]
            if not missing:
                break
            if (come := len(active) + len({node for node, _ in self._ready})) > most:
                most, without = come, 0.0
            if without > GATHER_S:
                self._lost |= dict.fromkeys(missing)
                self._log.error(f"{', '.join(missing)} not there after {waited:.0f} s: time begins without")
                break
            if waited - reported > REPORT_S:
                reported = waited
                self._log.warn(f"waiting for {', '.join(missing)} since {waited:.0f} s: did they start?")
            self._idle(self._raw)
            meanwhile()
        self._begun = True
        self.version += 1

    def update(self) -> None:
        """Process the members that joined, left, or answered.

        Tokens are read before answers, so that the leave of a member arrives before the loss of its token counts. A
        node declares its own token and its subscriptions before its readiness, so these are read after that.
        """
        tokens = list(iter(self._watch.poll, None))
        self._receive()
        for token in iter(self._reads_watch.poll, None):
            if (entity := Entity.parse(token.key)) is not None and entity.node in self._roster:
                self._note_reader(entity, token.alive)
        for token in iter(self._nodes_watch.poll, None):
            if (entity := Entity.parse(token.key)) is not None and entity.node in self._roster:
                _count(self._holders, (entity.node, entity.session), token.alive)
        for token in tokens:
            if (entity := Entity.parse(token.key)) is not None and entity.node in self._roster:
                self._note_readiness(entity, token.alive)
        self._admit()
        for member in self._members.values():
            if not member.active and self._all_here():
                self._send_join(member)

    def due(self, time_ns: int) -> bool:
        """Whether any member steps at this time."""
        return time_ns % self._stride == 0 and any(
            member.active and time_ns % member.period_ns == 0 for member in self._members.values()
        )

    def grant(self, go: StepGrant, outputs: Iterable[Publisher[Any]]) -> None:
        """Let the members that are due at ``go.time`` take their step, unless they were let before: none takes a tick
        twice.
        """
        news = sequence_numbers(outputs)
        merge_numbers(self._sent, news)
        self._broadcast(news, "sequence_numbers")
        if go.epoch > self._epoch >= 0:
            self.watermarks.epoch_changed = True
        self._epoch = go.epoch
        for session, member in self._members.items():
            if member.active and go.time % member.period_ns == 0 and member.last != (go.epoch, go.tick):
                self._pending[session] = member.last = go.epoch, go.tick
                self._step(member, go)

    def collect_reports(self, time_ns: int, interrupted: Callable[[], bool] = _never) -> bool:
        """Block until the members that are due at this time have finished their last step, died, or are given up.

        Their samples are then in ``watermarks``. Reports of others wait for their time: their arrival makes no
        difference.

        Returns:
            False if ``interrupted`` became true first; the next call continues.
        """
        self._receive()
        last = time.monotonic()
        while due := [session for session in self._pending if time_ns % self._members[session].period_ns == 0]:
            late: list[MemberState] = []
            for session in due:
                member = self._members[session]
                if (answer := member.answer) is None:
                    late.append(member)
                else:
                    del self._pending[session]
                    member.answer = None
                    self._receive_report(answer)
            if late:
                if interrupted():
                    return False
                if (now := time.monotonic()) - last > LOOK_S:
                    self._retry(late, now - last)
                    last = now
                self._idle(self._raw)
                self.update()
        return True

    def announce(self, go: StepGrant) -> None:
        """Send every member a message that grants no step: a pause."""
        for member in self._members.values():
            if member.active:
                self._pause(member, go)

    def _retry(self, late: list[MemberState], passed: float) -> None:
        """Send the request to silent members again, name them in the log, and give up those without a sign of life.

        Either message may have been lost: a flood overflows a ring. A member answers a repeated Go as before.
        """
        origins = (
            unpack_attachment(attachment) for _, attachment, _ in islice(iter(self._beats.recv, None), QUEUE_SIZE)
        )
        beats = {origin.publisher for origin in origins if origin is not None}
        now = time.monotonic()
        for member in late:
            passed = min(passed, MAX_LOOK_S)
            member.waited += passed
            member.unresponsive += passed
            if member.unresponsive > 1.0 and publisher_id(member.node, member.session, _HEALTH_KEY) in beats:
                member.unresponsive = 0.0
            if now - member.asked_at > LOOK_S:
                member.asked_at = now
                self._outbox.put(member.raw.put, member.asked, b"")
        slow = [member for member in late if member.waited > REPORT_S]
        if slow:
            listed = ", ".join(f"{member.node} since {member.waited:.0f} s" for member in slow)
            self._log.warn(f"the simulation waits for {listed}: does it compute, or does it hang?", every=REPORT_S)
        for member in slow:
            if member.unresponsive > SILENT_S or member.waited > MAX_WAIT_S:
                why = f"no answer for {member.waited:.0f} s, no sign of life for {member.unresponsive:.0f} s"
                self._give_up(member, why)

    def _give_up(self, member: MemberState, why: str) -> None:
        """Go on without a member; it may come back."""
        self._drop(member)
        self._not_before[member.session] = time.monotonic() + SILENT_S
        self._lose(member, why)

    def _lose(self, member: MemberState, why: str) -> None:
        """A member is gone without having taken leave; its commands go with it."""
        self.watermarks.lost_members.add(member.id)
        if self._begun and member.active:
            self._lost[member.node] = None
            self.version += 1
            self._log.warn(f"{member.node} is lost, the others go on without it: {why}")

    def _present(self) -> tuple[str, ...]:
        return tuple(sorted(member.node for member in self._members.values()))

    def _all_here(self) -> bool:
        """Greetings wait for the whole roster at the start; later ones go out at once."""
        if not self._generation:
            return False
        begun = self._begun or any(member.active for member in self._members.values())
        return begun or self._roster.keys() <= {*(member.node for member in self._members.values()), *self._absent}

    def _note_reader(self, entity: Entity, alive: bool) -> None:
        key = key_of(entity.name)
        readers = self._readers.get(key, Counter())
        if alive and self._reads >= MAX_SUBSCRIPTIONS:
            self.refusals.reject(
                f"{entity.node} has more than {MAX_SUBSCRIPTIONS} subscriptions: are its tokens forged?"
            )
        elif alive or entity.session in readers:
            self._reads += 1 if alive else -1
            _count(readers, entity.session, alive)
            self._readers[key] = readers
            if not readers:
                del self._readers[key]

    def _note_readiness(self, entity: Entity, alive: bool) -> None:
        """A node shows that it is ready to step, or it no longer does."""
        claim = entity.node, entity.session
        if alive and sum(node == entity.node for node, _ in self._ready) >= MAX_SESSIONS:
            self.refusals.reject(f"more than {MAX_SESSIONS} sessions show readiness as {entity.node}")
            return
        _count(self._ready, claim, alive)
        if claim not in self._ready:
            self._not_before.pop(entity.session, None)
            member = self._members.get(entity.session)
            if member is not None and member.node == entity.node:
                self._drop(member)
                self._gone.append(member)
                self._lose(member, "its process is gone")

    def _admit(self) -> None:
        """Add ready nodes as members: for each name without a member, the first session that holds it."""
        if len(self._ready) == len(self._members):
            return
        now = time.monotonic()
        taken = {member.node: member for member in self._members.values()}
        for node, session in self._ready:
            if session in self._members or (node, session) not in self._holders:
                continue
            if now < self._not_before.get(session, 0.0):
                continue
            if (holder := taken.get(node)) is not None:
                # A member that never answered its join is replaced by the next session of its name.
                if holder.active or not holder.asked or holder.waited < SILENT_S:
                    continue
                self._drop(holder)
                self._not_before[holder.session] = now + SILENT_S
            taken[node] = self._add(node, session)

    def _send_join(self, member: MemberState) -> None:
        """Greet a member, and again while it does not answer: either may be lost while links come up."""
        now = time.monotonic()
        if not member.asked:
            greeting = msgspec.structs.replace(self._now(), roster=self._present(), token=member.token)
            member.asked = encode(greeting)
        elif now - member.asked_at > RETRY_S:
            member.waited += RETRY_S
        else:
            return
        member.asked_at = now
        self._outbox.put(member.raw.put, member.asked, b"")

    def _add(self, node: str, session: str) -> MemberState:
        self._generation += 1
        outlet = self._transport.advertise(grant_key(session), ENCODING, Quality.EVENT)
        member = MemberState(node, session, member_id(node, session), outlet, secrets.token_bytes(TOKEN_BYTES))
        self._members[session] = member
        self._regroup()
        return member

    def _drop(self, member: MemberState) -> None:
        """Wait for this member no more."""
        self._generation += 1
        del self._members[member.session]
        self._pending.pop(member.session, None)
        self._regroup()
        self._outbox.flush()
        member.raw.close()

    def _regroup(self) -> None:
        """Members came, began or went. All their steps fall on multiples of the stride."""
        self.version += 1
        self.watermarks.regroup({member.id for member in self._members.values()})
        self._stride = math.gcd(*(member.period_ns for member in self._members.values())) or 1

    def _step(self, member: MemberState, go: StepGrant) -> None:
        """Let a member take its step, with all that is new for it."""
        members: tuple[bytes, ...] = ()
        if member.generation_sent < 0:
            self._grant_for(member)
        if member.generation_sent != self._generation:
            member.generation_sent = self._generation
            own = member_id(SIMULATION, self._transport.session)
            members = (*(each.id for each in self._members.values() if each is not member), own)
        marks, known, member.sequence_numbers, member.announced = member.sequence_numbers, member.announced, {}, {}
        leave = msgspec.structs.replace(
            go, members=members, marks=marks, known=known, token=member.token, nonce=member.nonce
        )
        member.asked, member.asked_at = encode(leave), time.monotonic()
        member.waited = member.unresponsive = 0.0
        self._outbox.put(member.raw.put, member.asked, b"")

    def _grant_for(self, member: MemberState) -> None:
        """Admit the samples sent before a member joined, without waiting for them: latched ones may be old."""
        for reached in (self.watermarks.admitted_upto, self._sent):
            for key, numbers in reached.items():
                if member.session in self._readers.get(key, ()):
                    merge_numbers(member.announced, {key: numbers})

    def _pause(self, member: MemberState, go: StepGrant) -> None:
        addressed = msgspec.structs.replace(go, token=member.token, nonce=member.nonce)
        self._outbox.put(member.raw.put, encode(addressed), b"")

    def _receive(self) -> None:
        for payload, _, source in islice(iter(self._raw.recv, None), QUEUE_SIZE):
            if self._raw.key(source) != self._key or len(payload) > MAX_BYTES:
                self._refuse("sent to many keys at once, or too large")
                continue
            try:
                done = decode_report(payload)
            except WrongPayload as error:
                self._refuse(str(error))
                continue
            if fault := self._answered(done):
                self._refuse(fault)
            else:
                self.refusals.received += 1

    def _answered(self, done: StepReport) -> str:
        """Take a Done; why it does not count, empty when it does."""
        member = self._members.get(done.session)
        if member is None and done.leaving and self._had_left(done):
            return ""
        if member is None:
            return f"from {done.session}, which is no member"
        if done.token != member.token:
            return f"for {member.node}, without the token that was sent to it: it is forged"
        if done.leaving:
            self._drop(member)
            self._not_before[done.session] = time.monotonic() + SILENT_S
            if self._begun and member.active:
                self._left[member.node] = None
                self.version += 1
            self._log.info(f"{member.node} has finished")
        elif done.greets:
            if not member.active:
                if fault := member.account(done):
                    return fault
                member.active, member.nonce, member.period_ns = True, done.nonce, done.period
                self._regroup()
                self._receive_report(done)
                if (now := self._now()).paused:
                    self._pause(member, now)
        elif self._pending.get(done.session) == (done.epoch, done.tick):
            if member.answer is None:
                if fault := member.account(done):
                    return fault
                member.answer = done
        elif (done.epoch, done.tick) > member.last:
            return f"{member.node} has finished tick {done.tick} of epoch {done.epoch}, which it was not let take"
        return ""

    def _had_left(self, done: StepReport) -> bool:
        """Whether a member whose token has disappeared leaves: on a busy machine its token overtakes its report."""
        for member in self._gone:
            if member.session == done.session and member.token == done.token:
                self._gone.remove(member)
                if self._lost.pop(member.node, self) is None:
                    self._left[member.node] = None
                    self.version += 1
                    self._log.info(f"{member.node} had finished")
                return True
        return False

    def _refuse(self, fault: str) -> None:
        self.refusals.reject(fault)
        self._log.warn(f"a Done is refused: {self.refusals.reason}", every=10.0)

    def _receive_report(self, done: StepReport) -> None:
        """Let through what a member says it has sent."""
        self._broadcast(done.marks, "sequence_numbers", done.session)
        self._broadcast(done.known, "announced", done.session)
        self.watermarks.advance(done.marks, done.known)

    def _broadcast(self, news: Numbers, kind: str, sender: str = "") -> None:
        """Keep the numbers for every member that reads the key."""
        for key, reached in news.items():
            for session in self._readers.get(key, ()):
                if session != sender and (member := self._members.get(session)) is not None:
                    kept: Numbers = getattr(member, kind)
                    kept.setdefault(key, {}).update(reached)


def _count(tokens: Counter[C], what: C, alive: bool) -> None:
    """One token more, or one less, that says the same."""
    tokens[what] += 1 if alive else -1
    if tokens[what] <= 0:
        del tokens[what]
