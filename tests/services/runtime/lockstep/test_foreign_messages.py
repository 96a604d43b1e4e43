"""Lockstep with foreign messages on its keys, a member that falls silent, and one that never joins."""

from __future__ import annotations

import io
import math
import random
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from messages.base import encode
from messages.std import Float64
from messages.topics import Quality, Topic
from services.runtime.context import Context
from services.runtime.errors import Stopped
from services.runtime.graph import Entity
from services.runtime.lockstep import barrier
from services.runtime.lockstep.member import LockstepMember
from services.runtime.lockstep.protocol import SIMULATION, StepGrant, StepReport, grant_key, report_key
from services.runtime.parameters.base import Parameters
from services.runtime.step import STEP_NS
from services.runtime.transport.api import RawSubscriber, Transport
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import publisher_id
from tests.harness.memory_node import memory_node
from tests.harness.waiting import wait_until
from tests.services.runtime.lockstep.test_lockstep import Member, Simulation

pytestmark = pytest.mark.waits

FAR = 2**62
ON_ZENOH = pytest.mark.parametrize("connect", ["zenoh"], indirect=True)
"""For tests that wait on the wall clock for a message that never arrives; the in-memory bus would add nothing."""


class LedMember:
    """The member's side of lockstep; the test sends the grants."""

    def __init__(self, bus: MemoryBus) -> None:
        self.simulation, self.transport = MemoryTransport(bus), MemoryTransport(bus)
        self.token = self.simulation.declare_token(Entity(self.simulation.session, "node", SIMULATION, "sim").key)
        self.follower = LockstepMember(self.transport, ["/m"], STEP_NS)
        self.answers = self.simulation.subscribe(report_key(self.simulation.session), 64)
        self._outlet = self.simulation.advertise(grant_key(self.transport.session), "", Quality.EVENT)
        self.greeting = self.go(roster=("/m",))

    def go(self, **given: object) -> StepGrant:
        return StepGrant(**{"simulation": self.simulation.session, "tick": 4, "time": 4 * STEP_NS, "epoch": 0} | given)  # type: ignore[arg-type]

    def take(self, *gos: StepGrant) -> list[StepGrant]:
        for go in gos:
            self._outlet.put(encode(go), attachment=b"")
        return list(iter(self.follower.poll, None))


@pytest.fixture
def member() -> LedMember:
    return LedMember(MemoryBus())


def test_a_go_counts_only_from_the_simulation_that_knows_the_nonce_and_never_backwards(member: LedMember) -> None:
    counts, session = member.follower.refusals, member.simulation.session
    forged = ("feed", "", "a?b", "a/b", "*", session, member.transport.session)
    assert member.take(*(member.go(simulation=each) for each in forged)) == []
    assert member.take(member.go(roster=("/other",)), member.go(roster=("/m", "\x1b[2J"))) == []
    assert counts.refused == len(forged) + 2
    assert member.take(member.go(simulation="feed", roster=("/m",))) == [], "it holds no token of the simulation"
    (greeting,) = member.take(member.greeting)
    member.follower.send_join(greeting, {}, {})
    nonce = member.follower._nonce_for(session)
    assert member.take(member.go()) == [], "it does not know the nonce"
    first, later = member.go(nonce=nonce), member.go(tick=8, nonce=nonce)
    assert member.take(first) == [first]
    refused = counts.refused
    bad = (
        member.go(nonce=b"x" * 8, tick=8),
        member.go(nonce=nonce, tick=3),
        member.go(nonce=nonce, tick=3, paused=True),
        member.go(nonce=nonce, tick=FAR),
        member.go(nonce=nonce, epoch=FAR),
        member.go(paused=True),
        member.go(simulation="feed", roster=("/m",)),
    )
    assert member.take(*bad) == []
    assert counts.refused == refused + len(bad)
    assert member.take(member.go(nonce=nonce, paused=True), later) == [member.go(nonce=nonce, paused=True), later]
    assert "\x1b" not in counts.reason


def test_another_simulation_leads_only_when_the_token_of_the_one_before_is_gone(member: LedMember) -> None:
    member.follower.send_join(member.take(member.greeting)[0], {}, {})
    first = member.go(nonce=member.follower._nonce_for(member.simulation.session), tick=100)
    assert member.take(first) == [first]
    session = "feed"
    greeting = member.go(simulation=session, roster=("/m",))
    claim = Entity(session, "node", SIMULATION, "sim")
    other = member.simulation.declare_token(claim.key)
    assert member.take(greeting) == []
    double = member.simulation.declare_token(Entity(member.simulation.session, "node", SIMULATION, "nothing").key)
    double.close()
    assert member.take(greeting) == [], "the token of a stranger went, not the simulation's"
    member.token.close()
    (taken,) = member.take(greeting)
    member.follower.send_join(taken, {}, {})
    again = member.go(simulation=session, nonce=member.follower._nonce_for(session), tick=0, time=0)
    assert member.take(again) == [again], "its time stands where it likes"
    other.close()


def test_a_greeting_counts_once_its_senders_token_is_in_sight(member: LedMember) -> None:
    member.token.close()
    assert member.take(member.greeting) == []
    member.simulation.declare_token(Entity(member.simulation.session, "node", SIMULATION, "sim").key)
    assert member.take() == [member.greeting]
    assert member.follower.refusals.refused == 0


def test_a_go_that_comes_again_is_answered_again_and_stepped_once(member: LedMember) -> None:
    member.follower.send_join(member.take(member.greeting)[0], {}, {})
    go = member.go(nonce=member.follower._nonce_for(member.simulation.session), token=b"t" * 8)
    assert member.take(go, go) == [go]
    member.follower.finish(4, {"a": {b"m" * 16: 1}}, {})
    before = list(iter(member.answers.recv, None))
    assert member.take(go) == []
    (again,) = iter(member.answers.recv, None)
    assert again[0] == before[-1][0]


@pytest.fixture
def simulation(connect: Callable[[], Transport]) -> Iterator[Simulation]:
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        yield Simulation(made, ("/a", "/b"))


def test_strangers_make_no_member_and_drop_none(connect: Callable[[], Transport], simulation: Simulation) -> None:
    members = [Member(connect(), name, 50, random.Random(0)) for name in ("a", "b")]
    try:
        simulation.barrier.wait_for_members()
        simulation.step(9)
        with connect() as stranger:
            assert members[0].node is not None
            victim, own = members[0].node.transport.session, stranger.session
            outlet = stranger.advertise(report_key(simulation.node.transport.session), "", Quality.EVENT)
            wait_until(lambda: outlet.has_subscribers, what="the simulation to hear the stranger")
            mine = publisher_id("/a", victim, "shared")
            for session in (victim, own, "feed"):
                for leaving, answers_join in ((True, False), (False, True), (False, False)):
                    for numbers in ({}, {"shared": {mine: FAR}}):
                        done = StepReport(
                            session=session,
                            tick=12,
                            sequence_numbers=numbers,
                            leaving=leaving,
                            answers_join=answers_join,
                            token=b"x" * 8,
                        )
                        outlet.put(encode(done), attachment=b"")
            tokens = [
                stranger.declare_token(each.key)
                for each in (
                    Entity(own, "step", "/a", detail=str(STEP_NS)),
                    Entity(victim, "step", "/a", detail="7"),
                    Entity(victim, "node", "/a", "nothing"),
                    Entity(own, "node", "/b", "member"),
                    Entity(own, "step", "/b", detail=str(STEP_NS)),
                    Entity(own, "step", "/nobody", detail=str(STEP_NS)),
                    Entity(victim, "sub", "/a", "/shared", "-", "-"),
                )
            ]
            counts = simulation.barrier.refusals
            wait_until(lambda: simulation.step(4) or counts.refused == 18, what="all of it to be refused")
            for token in tokens:
                token.close()
        simulation.step(41)
        assert simulation.barrier.state.members == ("/a", "/b")
        assert (simulation.barrier.state.lost, simulation.barrier.state.left) == ((), ())
        last = (simulation.tick - 1) // 4 * 4 * STEP_NS
        for each in members:
            times = [time_ns for time_ns, _, _ in each.seen]
            assert times == [20_000_000 * n for n in range(len(times))]
            assert times[-1] == last, each
            assert each.node is not None
            assert all(source.lost == 0 for source in each.node.subscribers)
    finally:
        for each in members:
            each.stop()


class SilentMember:
    """A member that answers its greeting and nothing else; ``steps`` counts the grants that it received."""

    def __init__(self, transport: Transport, name: str, beats: bool = False) -> None:
        self.steps = 0
        self.ended = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(transport, name, beats))
        self._thread.start()

    def _run(self, transport: Transport, name: str, beats: bool) -> None:
        with transport, memory_node(MemoryBus(), name, transport=transport) as made:
            follower = LockstepMember(transport, [made.identity.node], STEP_NS)
            follower.join()
            while not self.ended.is_set():
                if beats:
                    made.heartbeat.request_now()
                    made.spin_once()
                transport.wait(follower.raw)
                while (go := follower.poll()) is not None:
                    if go.roster:
                        follower.send_join(go, {}, {})
                    else:
                        self.steps += 1

    def stop(self) -> None:
        self.ended.set()
        self._thread.join(60)
        assert not self._thread.is_alive()


def _limit_the_wait_for_b(simulation: Simulation, monkeypatch: pytest.MonkeyPatch, **limits: float) -> None:
    """Set limits of the barrier [s] while it waits for ``/b`` alone; ``/a`` has the usual ones, however slow it is."""
    awaiting, idle = simulation.barrier, simulation.barrier._idle
    usual: dict[str, float] = {name: getattr(barrier, name) for name in limits}

    def wait(raw: RawSubscriber) -> None:
        alone = [awaiting._members[each].name for each in awaiting._pending] == ["/b"]
        for name, seconds in (limits if alone else usual).items():
            monkeypatch.setattr(barrier, name, seconds)
        for session in awaiting._not_before:  # once given up, ``/b`` does not come back
            awaiting._not_before[session] = math.inf
        idle(raw)

    monkeypatch.setattr(awaiting, "_idle", wait)


@ON_ZENOH
def test_who_never_answers_is_named_and_given_up_and_the_others_go_on(
    connect: Callable[[], Transport], simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    _limit_the_wait_for_b(simulation, monkeypatch, REPORT_S=0.1, SILENT_S=1.5)
    log = simulation.node.log._out = io.StringIO()
    alive, mute = Member(connect(), "a", 50, random.Random(0)), SilentMember(connect(), "b")
    try:
        simulation.barrier.wait_for_members()
        simulation.step(9)
        assert simulation.barrier.state.lost == ("/b",)
        assert simulation.barrier.state.members == ("/a",)
        assert len(simulation.barrier.watermarks.lost_members) == 1, "its commands go with it"
        assert mute.steps == 1, "it was asked again and again, for the same step"
        assert "waiting for /b for" in log.getvalue()
        assert "/b is lost, the others go on without it: no answer for" in log.getvalue()
        assert [time_ns for time_ns, _, _ in alive.seen] == [0, 4 * STEP_NS, 8 * STEP_NS]
    finally:
        alive.stop()
        mute.stop()


@ON_ZENOH
def test_who_beats_is_slow_and_not_dead_for_a_while(
    connect: Callable[[], Transport], simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    _limit_the_wait_for_b(simulation, monkeypatch, REPORT_S=0.1, SILENT_S=1.5, MAX_WAIT_S=2.5)
    log = simulation.node.log._out = io.StringIO()
    alive, mute = Member(connect(), "a", 50, random.Random(0)), SilentMember(connect(), "b", beats=True)
    try:
        simulation.barrier.wait_for_members()
        simulation.step(5)
        assert simulation.barrier.state.lost == ("/b",)
        (line,) = [each for each in log.getvalue().splitlines() if "is lost" in each]
        unanswered = re.search(r"no answer for (\d+) s, no sign of life for \d+ s", line)
        assert unanswered, line
        assert int(unanswered[1]) >= 2, line
    finally:
        alive.stop()
        mute.stop()


@ON_ZENOH
def test_time_begins_without_who_never_comes(
    connect: Callable[[], Transport], simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(barrier, "GATHER_S", 1.0)
    log = simulation.node.log._out = io.StringIO()
    alone = Member(connect(), "a", 50, random.Random(0))
    try:
        simulation.barrier.wait_for_members()
        assert simulation.barrier.state.lost == ("/a", "/b"), "nobody steps before all are there"
        assert "/a, /b did not join within" in log.getvalue()

        def stepped() -> bool:
            simulation.step(4)
            return len(alone.seen) > 2

        wait_until(stepped, what="the one that is there to step with the simulation")
    finally:
        alone.stop()


LATCHED = Topic("/plan", Float64, 0, Quality.LATCHED, "what a member told long ago")


def test_who_comes_late_has_what_members_and_simulation_told_long_ago(connect: Callable[[], Transport]) -> None:
    seen: list[float] = []
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/a", "/b"))
        frame = made.advertise(LATCHED, "/frame")

        def tell(ctx: Context[Parameters]) -> None:
            for tick in ctx.ticks():
                if tick.time == 0:
                    ctx.publish(LATCHED, Float64(data=5.0))

        def hear(ctx: Context[Parameters]) -> None:
            plan, frames = ctx.latest(LATCHED), ctx.latest(LATCHED.named("/frame"))
            for _ in ctx.ticks():
                if plan.value is not None and frames.value is not None:
                    seen.append(plan.value.data + frames.value.data)

        def late() -> list[float]:
            simulation.step(4)
            return seen

        with LoopingMember(connect(), "a", tell):
            with LoopingMember(connect(), "b", lambda ctx: [None for _ in ctx.ticks()]):
                simulation.barrier.wait_for_members()
                frame.publish(Float64(data=2.0))
                simulation.step(20)
            simulation.step(20)
            with LoopingMember(connect(), "b", hear):
                assert wait_until(late, what="both values at who came late")[0] == 7.0


class LoopingMember:
    """A member's loop in a thread, ended by ``with``."""

    def __init__(self, transport: Transport, name: str, run: Callable[[Context[Parameters]], object]) -> None:
        self._transport, self._name, self._run = transport, name, run
        self._made = memory_node(MemoryBus(), name, transport=transport)
        self._thread = threading.Thread(target=self._body)

    def _body(self) -> None:
        with self._transport, self._made, suppress(Stopped):
            self._run(Context(self._made, Parameters(), 50.0, lockstep=True))

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *exception: object) -> None:
        self._made.stopping = True
        self._transport.wake()
        self._thread.join(60)
        assert not self._thread.is_alive()
