"""The simulation's side of lockstep: a barrier at each tick."""

from __future__ import annotations

import math
import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import islice
from typing import Any, TypeVar

import msgspec

from messages.base import WrongPayload, encode
from messages.elea import LockstepState
from messages.names import key as key_of
from messages.topics import HEALTH, Quality
from services.runtime.graph import Entity, token_pattern
from services.runtime.lockstep.held_requests import HeldRequests
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
from services.runtime.subscription_tokens import SubscriptionTokens
from services.runtime.transport.api import RawSubscriber, Transport
from services.runtime.transport.sequences import RefusalCounter
from services.runtime.transport.wire import member_id, publisher_id, unpack_attachment

RETRY_S = 2.0
"""Wall time [s] after which missing tokens are queried, and unanswered messages sent, again."""
REPORT_S = 5.0
"""Wall time [s] between two log lines that list the awaited members."""
GATHER_S = 120.0
"""Wall time [s] without a new member after which simulation time starts without the missing ones."""
SILENT_S = 30.0
"""Wall time [s] after which a member without answer and heartbeat is dropped; a supervisor ends a hung one sooner."""
MAX_WAIT_S = 300.0
"""The same for a member with heartbeats: it is slow, not dead."""
RESEND_S = 0.25
"""Wall time [s] after which a message to a late member is repeated: a flood may have pushed out the first."""
TOKEN_S = 30.0
"""Maximum wall time [s] for the token of a new subscription to arrive, while its process is there."""
LAST_REPORT_S = 0.5
"""Wall time [s] to wait for the report of a member whose token has disappeared: tokens overtake reports."""
MAX_COUNTED_S = 0.5
"""Maximum waiting time [s] counted per check: a machine too busy to check has not waited."""
MAX_IDLE_NS = 100_000_000
"""Maximum simulation time [ns] for which an idle member gets no step. Events other than messages, such as a request to
end its process, wait for its next step."""
MAX_SESSIONS = 16
"""Maximum sessions that declare readiness under the name of one node; all but one may be about to end or to start."""
MAX_SUBSCRIPTIONS = 1 << 17
"""Maximum subscriptions of the roster's nodes that are kept."""

_HEALTH_KEY = key_of(HEALTH.name)

C = TypeVar("C")


def _nothing() -> None:
    pass


def _never() -> bool:
    return False


class Barrier:
    """Waits for the members of lockstep at each tick.

    ``idle`` is called with the subscriber to wait on; ``now`` returns the simulation's time and tick. The member of an
    expected node is the session that declares readiness under its name and holds its token; nodes that share a process
    are one member. A Done is accepted only with the token that this barrier sent to its member. ``refusals`` counts
    refused messages.
    """

    def __init__(
        self,
        transport: Transport,
        send_buffer: SendBuffer,
        roster: tuple[str, ...],
        log: Log,
        idle: Callable[[RawSubscriber], None],
        now: Callable[[], StepGrant],
        subscriptions: SubscriptionTokens | None = None,
    ) -> None:
        self.watermarks = Watermarks()
        self.refusals = RefusalCounter("lockstep: Done")
        self._transport, self._send_buffer, self._roster = transport, send_buffer, dict.fromkeys(roster)
        self._log, self._idle, self._now = log, idle, now
        self._key = report_key(transport.session)
        self._raw = transport.subscribe(self._key, QUEUE_SIZE)
        self._beats = transport.subscribe(_HEALTH_KEY, QUEUE_SIZE)
        self._subscriptions = subscriptions or SubscriptionTokens(transport)
        self._subscriptions.listener = self._note_reader
        self._watch = transport.watch(token_pattern("step"))
        self._nodes_watch = transport.watch(token_pattern("node"))
        # Tokens that differ only in their last chunks mean the same and may exist side by side, so they are counted.
        self._readers: dict[str, Counter[str]] = {}
        """By key, the sessions of the roster's nodes that subscribe to it, with their number of tokens."""
        self._declared: dict[str, dict[str, None]] = {}
        """By key, the sessions that have reported a subscription, whether its token has arrived or not."""
        self._beginning: list[tuple[str, tuple[str, ...]]] = []
        """The sessions that report new keys in this step, and the keys; effective once the step is complete."""
        self._latching: set[bytes] = set()
        """The publishers of latched topics."""
        self._reads = 0
        self._ready: Counter[tuple[str, str]] = Counter()
        """Nodes of the roster, and the sessions that declare readiness under their names."""
        self._sharing: dict[tuple[str, str], int] = {}
        """The number of nodes that each of these sessions declares."""
        self._holders: Counter[tuple[str, str]] = Counter()
        """Nodes of the roster, and the sessions that hold their names."""
        self._not_before: dict[str, float] = {}
        """Wall time before which a session that left or was dropped cannot become a member again."""
        self._members: dict[str, MemberState] = {}
        self._gone: deque[MemberState] = deque(maxlen=QUEUE_SIZE)
        """The last members whose processes disappeared before they reported leaving."""
        self._joining: list[MemberState] = []
        """The members that have not answered their join."""
        self._pending: dict[str, tuple[int, int]] = {}
        self._answers: dict[str, None] = {}
        """The pending sessions whose answers have arrived."""
        self._held = HeldRequests()
        self._sent: Numbers = {}
        """The numbers of the simulation's own samples."""
        self._outputs: Iterable[Publisher[Any]] = ()
        self._lost: dict[str, None] = {}
        self._left: dict[str, None] = {}
        self._ending: dict[str, float] = {}
        """Sessions whose token has disappeared and whose last report may be on its way, with the wall time [s]."""
        self.version = 0
        """Incremented whenever ``state`` may have changed."""
        self._begun = False
        self._member_nodes = 0
        """The number of nodes of all members."""
        self._generation = 0
        self._stride = 1
        self._epoch = -1
        self._absent: frozenset[str] = frozenset()

    @property
    def state(self) -> LockstepState:
        """The current members, and those lost and those that left since simulation time started."""
        return LockstepState(
            members=tuple(sorted(self._active())),
            lost=tuple(self._lost),
            left=tuple(self._left),
        )

    def wait_for_members(self, absent: Collection[str] = (), meanwhile: Callable[[], None] = _nothing) -> None:
        """Block until the whole roster has joined and every member sees every other.

        After GATHER_S without a new member, simulation time starts without the missing ones, which count as lost.

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
            passed = min(now - last, MAX_COUNTED_S)
            last, waited, without = now, waited + passed, without + passed
            if now - looked > RETRY_S:
                looked = now
                for watch in (self._nodes_watch, self._watch, self._subscriptions):
                    watch.refresh()
            self.update()
            active = self._active()
            missing = [node for node in self._roster if node not in active | self._absent]
            if not missing:
                break
            if (come := len(active) + len({node for node, _ in self._ready})) > most:
                most, without = come, 0.0
            if without > GATHER_S:
                self._lost |= dict.fromkeys(missing)
                self._log.error(f"{', '.join(missing)} did not join within {waited:.0f} s: time starts without them")
                break
            if waited - reported > REPORT_S:
                reported = waited
                self._log.warn(f"waiting for {', '.join(missing)} for {waited:.0f} s: did they start?")
            self._idle(self._raw)
            meanwhile()
        self._begun = True
        self.version += 1

    def update(self) -> None:
        """Process the members that joined, left, or answered.

        Tokens are read before answers and processed after them, so that a member's leave is seen before the loss of its
        token. A node declares its own token and its subscriptions before its readiness, so these are read after that.
        """
        tokens = list(iter(self._watch.poll, None))
        self._receive()
        self._subscriptions.update()
        for token in iter(self._nodes_watch.poll, None):
            if (entity := Entity.parse(token.key)) is not None and entity.node in self._roster:
                _count(self._holders, (entity.node, entity.session), token.alive)
        for token in tokens:
            if (entity := Entity.parse(token.key)) is not None and entity.node in self._roster:
                self._note_readiness(entity, token.alive)
        for session, since in list(self._ending.items()):
            if time.monotonic() - since > LAST_REPORT_S:
                self._remove(self._members[session])
        self._admit()
        if self._joining and self._all_here():
            for member in self._joining:
                self._send_join(member)

    def due(self, time_ns: int) -> bool:
        """Return whether any member steps at this time [ns]."""
        return time_ns % self._stride == 0 and any(
            member.active and time_ns % member.period_ns == 0 for member in self._members.values()
        )

    def grant(self, go: StepGrant, outputs: Iterable[Publisher[Any]]) -> None:
        """Grant a step to the members that are due at ``go.time`` and have work, unless they already have this tick:
        none takes a tick twice.
        """
        self._outputs = outputs
        news = sequence_numbers(outputs)
        merge_numbers(self._sent, news)
        self._broadcast(news, "sequence_numbers")
        if go.epoch > self._epoch >= 0:
            self.watermarks.epoch_changed = True
            for member in self._members.values():
                member.idle_until = 0
        self._epoch = go.epoch
        for session, member in self._members.items():
            if (
                member.active
                and go.time % member.period_ns == 0
                and member.last != (go.epoch, go.tick)
                and member.has_work(go.time, self._generation)
            ):
                self._pending[session] = member.last = go.epoch, go.tick
                member.stepped_at = go.time
                self._step(member, go)

    def collect_reports(self, time_ns: int, interrupted: Callable[[], bool] = _never) -> bool:
        """Block until the members that are due at this time have finished their last step, died, or were dropped.

        Their samples are then in ``watermarks``. Reports of other members are kept until they are due, so the time of
        their arrival makes no difference.

        Returns:
            False if ``interrupted`` became true first; the next call continues.
        """
        self._receive()
        last = time.monotonic()
        late = {session for session in self._pending if time_ns % self._members[session].period_ns == 0}
        while True:
            for session in [each for each in self._answers if each in late]:
                self._take_answer(self._members[session])
            late &= self._pending.keys()
            if not late:
                break
            if interrupted():
                return False
            if (now := time.monotonic()) - last > RESEND_S:
                self._retry([self._members[each] for each in self._pending if each in late], now - last)
                last = now
            self._idle(self._raw)
            self.update()
        self._begin_reading()
        return True

    def _take_answer(self, member: MemberState) -> None:
        """Process the report of a due member that has finished its step."""
        answer, member.answer = member.answer, None
        del self._answers[member.session], self._pending[member.session]
        assert answer is not None
        self._receive_report(answer)
        member.idle_until = min(answer.idle_until, member.stepped_at + MAX_IDLE_NS)
        if answer.leaving:
            self._leave(member)
        elif answer.left:
            self._release(member, answer.left)

    def hold(self, sender: bytes, carry_out: Callable[[], None]) -> bool:
        """Hold a request that a member makes within its step; returns False for any other request."""
        for session in self._pending:
            if sender in (member := self._members[session]).ids.values():
                return member.answer is None and self._held.hold(member, carry_out)
        return False

    def release(self) -> None:
        """Carry out the held requests once every due member has finished or waits for a reply."""
        if not self._held:
            return
        now = self._now()
        unfinished = [each for each in map(self._members.__getitem__, self._pending) if each.answer is None]
        due = [each for each in unfinished if now.paused or now.time % each.period_ns == 0]
        self._held.release(due, [each for each in unfinished if each not in due])

    def announce(self, go: StepGrant) -> None:
        """Send every member a message that grants no step: a pause."""
        for member in self._members.values():
            if member.active:
                self._pause(member, go)

    def _begin_reading(self) -> None:
        """Deliver what is sent from now on to the members that have subscribed to keys in this step.

        They skip earlier samples, except the last one of each latched topic, so the time at which their subscriptions
        became visible makes no difference. Blocks until the subscriptions' tokens arrive, so that what the simulation
        sends next reaches them. The other members do the same before their next steps: among peers, a subscription
        reaches each on a link of its own.
        """
        if not self._beginning:
            return
        beginning, self._beginning = self._beginning, []
        latching = self._latching | {each.publisher for each in self._outputs if each.topic.quality is Quality.LATCHED}
        for session, keys in beginning:
            if (member := self._members.get(session)) is None:
                continue
            for key in keys:
                self._declared.setdefault(key, {})[session] = None
                for other in self._members.values():
                    if other is not member:
                        other.readers.setdefault(key, {})[session] = None
                member.sequence_numbers.pop(key, None)
                member.announced.pop(key, None)
                reached = {**self.watermarks.admitted_upto.get(key, {}), **self._sent.get(key, {})}
                skipped: dict[bytes, int] = {}
                for publisher, number in reached.items():
                    if member.owns(publisher):
                        continue
                    latched = publisher in latching
                    skipped[publisher] = number - latched
                    if latched:
                        member.sequence_numbers.setdefault(key, {})[publisher] = number
                member.skipped[key] = skipped
            deadline = time.monotonic() + TOKEN_S
            while any(session not in self._readers.get(key, ()) for key in keys) and time.monotonic() < deadline:
                self._idle(self._raw)
                self.update()
                if session not in self._members:
                    break

    def _retry(self, late: list[MemberState], passed: float) -> None:
        """Repeat the message to silent members, log their names, and drop those without a sign of life.

        The message or its answer may have been lost: a flood overflows a ring. A member repeats its answer to a
        repeated Go.
        """
        origins = (
            unpack_attachment(attachment) for _, attachment, _ in islice(iter(self._beats.recv, None), QUEUE_SIZE)
        )
        beats = {origin.publisher for origin in origins if origin is not None}
        now = time.monotonic()
        for member in late:
            passed = min(passed, MAX_COUNTED_S)
            member.waited += passed
            member.unresponsive += passed
            if member.unresponsive > 1.0 and any(
                publisher_id(node, member.session, _HEALTH_KEY) in beats for node in member.ids
            ):
                member.unresponsive = 0.0
            if now - member.asked_at > RESEND_S:
                member.asked_at = now
                self._send_buffer.put(member.raw.put, member.asked, b"")
        slow = [member for member in late if member.waited > REPORT_S]
        if slow:
            listed = ", ".join(f"{member.name} for {member.waited:.0f} s" for member in slow)
            self._log.warn(f"the simulation has been waiting for {listed}: is it computing, or hung?", every=REPORT_S)
        for member in slow:
            if member.unresponsive > SILENT_S or member.waited > MAX_WAIT_S:
                why = f"no answer for {member.waited:.0f} s, no sign of life for {member.unresponsive:.0f} s"
                self._give_up(member, why)

    def _give_up(self, member: MemberState, why: str) -> None:
        """Continue without a member; it may come back after SILENT_S."""
        self._drop(member)
        self._not_before[member.session] = time.monotonic() + SILENT_S
        self._lose(member, why)

    def _lose(self, member: MemberState, why: str) -> None:
        """Record a member that is gone without having left; its commands are dropped."""
        self.watermarks.lost_members.update(member.ids.values())
        if self._begun and member.active:
            self._lost |= dict.fromkeys(member.ids)
            self.version += 1
            self._log.warn(f"{member.name} is lost, the others go on without it: {why}")

    def _present(self) -> tuple[str, ...]:
        return tuple(sorted(node for member in self._members.values() for node in member.ids))

    def _active(self) -> set[str]:
        return {node for member in self._members.values() if member.active for node in member.ids}

    def _all_here(self) -> bool:
        """Return whether joins may be sent: at the start once the whole roster is ready, later at once."""
        if not self._generation:
            return False
        begun = self._begun or any(member.active for member in self._members.values())
        return begun or self._roster.keys() <= {*self._present(), *self._absent}

    def _note_reader(self, entity: Entity, alive: bool) -> None:
        if entity.node not in self._roster:
            return
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
        """Process a token of readiness that appeared or disappeared."""
        claim = entity.node, entity.session
        if alive and sum(node == entity.node for node, _ in self._ready) >= MAX_SESSIONS:
            self.refusals.reject(f"more than {MAX_SESSIONS} sessions show readiness as {entity.node}")
            return
        _count(self._ready, claim, alive)
        if alive:
            self._sharing[claim] = entity.sharing
            self._ending.pop(entity.session, None)
        if claim not in self._ready:
            self._sharing.pop(claim, None)
            self._not_before.pop(entity.session, None)
            member = self._members.get(entity.session)
            if member is not None and entity.node in member.ids:
                if member.answer is not None and member.answer.leaving:
                    return  # its last report has arrived, and is processed with those of its tick
                if member.answer is None and member.session in self._pending:
                    self._ending.setdefault(member.session, time.monotonic())
                else:
                    self._remove(member)

    def _remove(self, member: MemberState) -> None:
        """Remove a member whose process has disappeared."""
        self._drop(member)
        self._gone.append(member)
        self._lose(member, "its process is gone")

    def _admit(self) -> None:
        """Add ready sessions as members: for each name without a member, the first session that holds it.

        One with several nodes is ready when all of them are.
        """
        if len(self._ready) == self._member_nodes:
            return
        claims: dict[tuple[str, int], list[str]] = {}
        for claim in self._ready:
            node, session = claim
            if session not in self._members and claim in self._holders:
                claims.setdefault((session, self._sharing[claim]), []).append(node)
        now = time.monotonic()
        taken = {node: member for member in self._members.values() for node in member.ids}
        for (session, size), nodes in claims.items():
            if len(nodes) != size or session in self._members or now < self._not_before.get(session, 0.0):
                continue
            holders = {taken[node].session: taken[node] for node in nodes if node in taken}
            # A member that never answered its join is replaced by the next session of its name.
            if any(each.active or not each.asked or each.waited < SILENT_S for each in holders.values()):
                continue
            for holder in holders.values():
                self._drop(holder)
                self._not_before[holder.session] = now + SILENT_S
            taken |= dict.fromkeys(nodes, self._add(nodes, session))

    def _send_join(self, member: MemberState) -> None:
        """Send a join, and repeat it until it is answered: either message may be lost while links come up."""
        now = time.monotonic()
        if not member.asked:
            join = msgspec.structs.replace(self._now(), roster=self._present(), token=member.token)
            member.asked = encode(join)
        elif now - member.asked_at > RETRY_S:
            member.waited += RETRY_S
        else:
            return
        member.asked_at = now
        self._send_buffer.put(member.raw.put, member.asked, b"")

    def _add(self, nodes: Iterable[str], session: str) -> MemberState:
        self._generation += 1
        publisher = self._transport.advertise(grant_key(session), ENCODING, Quality.EVENT)
        ids = {node: member_id(node, session) for node in sorted(nodes)}
        member = MemberState(ids, session, publisher, secrets.token_bytes(TOKEN_BYTES))
        self._members[session] = member
        self._regroup()
        return member

    def _drop(self, member: MemberState) -> None:
        """Remove a member, so that its steps are no longer awaited."""
        self._generation += 1
        del self._members[member.session]
        self._pending.pop(member.session, None)
        self._answers.pop(member.session, None)
        self._ending.pop(member.session, None)
        for key, sessions in list(self._declared.items()):
            if sessions.pop(member.session, self) is None and not sessions:
                del self._declared[key]
        self._latching = {each for each in self._latching if not member.owns(each)}
        self._regroup()
        self._send_buffer.flush()
        member.raw.close()

    def _regroup(self) -> None:
        """Update what depends on the members after one was added, became active or was removed.

        All their steps fall on multiples of the stride.
        """
        self.version += 1
        self._member_nodes = sum(len(member.ids) for member in self._members.values())
        self._joining = [member for member in self._members.values() if not member.active]
        self.watermarks.regroup({each for member in self._members.values() for each in member.ids.values()})
        self._stride = math.gcd(*(member.period_ns for member in self._members.values())) or 1

    def _step(self, member: MemberState, go: StepGrant) -> None:
        """Send a member its Go, with all that is new for it."""
        members: tuple[bytes, ...] = ()
        if member.generation_sent < 0:
            self._grant_for(member)
            member.readers = {key: {**sessions} for key, sessions in self._declared.items()}
        if member.generation_sent != self._generation:
            member.generation_sent = self._generation
            own = member_id(SIMULATION, self._transport.session)
            others = (each for each in self._members.values() if each is not member)
            members = (*(number for each in others for number in each.ids.values()), own)
        numbers, member.sequence_numbers = member.sequence_numbers, {}
        announced, member.announced = member.announced, {}
        skipped, member.skipped = member.skipped, {}
        readers, member.readers = self._still_reading(member.readers), {}
        grant = msgspec.structs.replace(
            go,
            members=members,
            sequence_numbers=numbers,
            announced=announced,
            token=member.token,
            nonce=member.nonce,
            skipped=skipped,
            readers=readers,
        )
        member.asked, member.asked_at = encode(grant), time.monotonic()
        member.waited = member.unresponsive = 0.0
        self._send_buffer.put(member.raw.put, member.asked, b"")

    def _still_reading(self, readers: Mapping[str, Iterable[str]]) -> dict[str, tuple[str, ...]]:
        """Return the subscriptions, sessions by key, whose tokens are still there."""
        there: dict[str, tuple[str, ...]] = {}
        for key, sessions in readers.items():
            if kept := tuple(each for each in sessions if each in self._readers.get(key, ())):
                there[key] = kept
        return there

    def _grant_for(self, member: MemberState) -> None:
        """Admit the samples sent before a member joined, without waiting for them: latched ones may be old."""
        for reached in (self.watermarks.admitted_upto, self._sent):
            for key, numbers in reached.items():
                if member.session in self._readers.get(key, ()) or member.session in self._declared.get(key, ()):
                    merge_numbers(member.announced, {key: numbers})

    def _pause(self, member: MemberState, go: StepGrant) -> None:
        addressed = msgspec.structs.replace(go, token=member.token, nonce=member.nonce)
        self._send_buffer.put(member.raw.put, encode(addressed), b"")

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
        """Process a Done; returns why it is refused, empty if it is accepted."""
        member = self._members.get(done.session)
        if member is None and done.leaving and self._had_left(done):
            return ""
        if member is None:
            return f"from {done.session!r}, which is not a member"
        if done.token != member.token:
            return f"for {member.name}, without the token that was sent to it: it is forged"
        if done.leaving and done.tick < 0:
            self._leave(member)
        elif done.answers_join:
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
                member.answer, self._answers[member.session] = done, None
        elif (done.epoch, done.tick) > member.last:
            return f"{member.name} has finished tick {done.tick} of epoch {done.epoch}, which it was not granted"
        return ""

    def _leave(self, member: MemberState) -> None:
        """Remove a member that is leaving; its commands end with its last report, at the same tick in every run."""
        self._drop(member)
        self._not_before[member.session] = time.monotonic() + SILENT_S
        self._note_leave(member, tuple(member.ids))

    def _note_leave(self, member: MemberState, nodes: Iterable[str]) -> None:
        self.watermarks.lost_members.update(member.ids[node] for node in nodes)
        if self._begun and member.active:
            self._left |= dict.fromkeys(nodes)
            self.version += 1
        self._log.info(f"{', '.join(nodes)} has finished")

    def _release(self, member: MemberState, nodes: Iterable[str]) -> None:
        """Remove the nodes of a member that have ended while others continue."""
        if gone := [node for node in nodes if node in member.ids]:
            self._note_leave(member, gone)
            member.release(gone)
            self._generation += 1
            self._regroup()

    def _had_left(self, done: StepReport) -> bool:
        """Return whether a leaving report is of a member already lost: on a busy machine its token overtakes it."""
        for member in self._gone:
            if member.session == done.session and member.token == done.token:
                self._gone.remove(member)
                if were := [node for node in member.ids if self._lost.pop(node, self) is None]:
                    self._left |= dict.fromkeys(were)
                    self.version += 1
                    self._log.info(f"{', '.join(were)} had finished")
                return True
        return False

    def _refuse(self, fault: str) -> None:
        self.refusals.reject(fault)
        self._log.warn(f"a Done is refused: {self.refusals.reason}", every=10.0)

    def _receive_report(self, done: StepReport) -> None:
        """Admit the samples that a member reports as sent."""
        self._broadcast(done.sequence_numbers, "sequence_numbers", done.session)
        self._broadcast(done.announced, "announced", done.session)
        self.watermarks.advance(done.sequence_numbers, done.announced)
        if done.latches:
            member = self._members.get(done.session)
            self._latching |= {each for each in done.latches if member and member.owns(each)}
        if done.reads:
            self._beginning.append((done.session, done.reads))

    def _broadcast(self, news: Numbers, kind: str, sender: str = "") -> None:
        """Queue the numbers for every member that subscribes to the key."""
        for key, reached in news.items():
            readers: Iterable[str] = self._readers.get(key, ())
            if (declared := self._declared.get(key)) is not None:
                readers = {**declared, **dict.fromkeys(readers)}
            for session in readers:
                if session != sender and (member := self._members.get(session)) is not None:
                    kept: Numbers = getattr(member, kind)
                    kept.setdefault(key, {}).update(reached)


def _count(tokens: Counter[C], what: C, alive: bool) -> None:
    """Count a token with the same meaning that appeared or disappeared."""
    tokens[what] += 1 if alive else -1
    if tokens[what] <= 0:
        del tokens[what]
