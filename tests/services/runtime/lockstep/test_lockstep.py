"""Lockstep between real loops in threads: the same run whatever the timing; members that die, join, or see a pause."""

from __future__ import annotations

import math
import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice, pairwise
from typing import Any

import pytest

from messages.std import Float64
from messages.topics import Quality, Topic
from services.runtime.context import Context
from services.runtime.errors import BadInput, Stopped
from services.runtime.graph import token_pattern
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.node import Node
from services.runtime.pacing import Instant, LockstepPacer
from services.runtime.parameters.base import Parameters
from services.runtime.step import STEP_NS, period_of
from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus
from services.runtime.transport.wire import member_id
from tests.harness.cases import case
from tests.harness.memory_node import memory_node
from tests.harness.waiting import wait_until

TRUTH = Topic("/truth", Float64, 50, Quality.SENSOR, "what the simulation tells")
SHARED = Topic("/shared", Float64, 50, Quality.EVENT, "what all members write and read")
EFFORT = Topic("/effort", Float64, 50, Quality.COMMAND, "what the simulation obeys")


class Member:
    """A loop that mixes all received messages into a number, sleeps at random, and publishes the number."""

    def __init__(self, transport: Transport, name: str, rate: float, dawdle: random.Random) -> None:
        self.seen: list[tuple[int, tuple[float, ...], tuple[float, ...]]] = []
        self.ended = threading.Event()
        self._transport, self._name, self._rate, self._dawdle = transport, name, rate, dawdle
        self.node: Node | None = None
        self.thread = threading.Thread(target=self._body)
        self.thread.start()

    def _body(self) -> None:
        with self._transport, memory_node(MemoryBus(), self._name, transport=self._transport) as made:
            self.node = made
            with suppress(Stopped):
                self._run(Context(made, Parameters(), self._rate, lockstep=True))

    def _run(self, ctx: Context[Any]) -> None:
        truth, shared = ctx.stream(TRUTH), ctx.stream(SHARED)
        value = 0.0
        for tick in ctx.ticks():
            heard = tuple(m.data for m in truth.drain())
            said = tuple(m.data for m in shared.drain())
            self.seen.append((tick.time, heard, said))
            if self.ended.is_set():
                self._transport.close()
                return
            time.sleep(self._dawdle.random() * 0.003)
            value = 0.9 * value + sum(heard) + 0.1 * sum(said)
            ctx.publish(SHARED, Float64(data=value))
            ctx.publish(EFFORT, Float64(data=value + len(self._name)))

    def stop(self) -> None:
        if self.node is not None:
            self.node.stopping = True
            self.node.transport.wake()
        self.thread.join(60)
        assert not self.thread.is_alive()


def _steps(ctx: Context[Any], pacer: LockstepPacer) -> Iterator[Instant]:
    """Join lockstep and yield each step that the simulation grants."""
    pacer.start()
    while True:
        ctx.node.spin_once()
        if (instant := pacer.next()) is None:
            ctx.node.wait(pacer.raw)
        else:
            yield instant


class Idler(Member):
    """A member that reports after each step for how long it will be idle."""

    def __init__(self, transport: Transport, name: str, idle_ns: int) -> None:
        self._idle_ns = idle_ns
        super().__init__(transport, name, 50.0, random.Random(0))

    def _run(self, ctx: Context[Any]) -> None:
        shared = ctx.node.subscribe(SHARED)
        pacer = LockstepPacer(ctx.node, period_of(self._rate, True))
        for instant in _steps(ctx, pacer):
            ctx.node.update_subscribers(pacer.watermarks)
            self.seen.append((instant.time, (), tuple(message.data for message, _ in shared.messages)))
            pacer.finish(idle_until=instant.time + self._idle_ns)


class Leaver(Member):
    """A member that leaves lockstep with its second step, and the network at once."""

    def __init__(self, transport: Transport, name: str) -> None:
        super().__init__(transport, name, 50.0, random.Random(0))

    def _run(self, ctx: Context[Any]) -> None:
        pacer = LockstepPacer(ctx.node, period_of(self._rate, True))
        for instant in islice(_steps(ctx, pacer), 2):
            self.seen.append((instant.time, (), ()))
            ctx.publish(SHARED, Float64(data=7.0))
            pacer.finish(leaving=len(self.seen) == 2)


class LateReader(Member):
    """A member that subscribes in its third step."""

    def __init__(self, transport: Transport, name: str) -> None:
        super().__init__(transport, name, 50.0, random.Random(0))

    def _run(self, ctx: Context[Any]) -> None:
        pacer, shared = LockstepPacer(ctx.node, period_of(self._rate, True), reports_reads=True), None
        for instant in _steps(ctx, pacer):
            ctx.node.update_subscribers(pacer.watermarks)
            if len(self.seen) == 2:
                shared = ctx.node.subscribe(SHARED)
            heard = () if shared is None else tuple(message.data for message, _ in shared.messages)
            self.seen.append((instant.time, (), heard))
            pacer.finish()


class Simulation:
    """A minimal simulation: a number changed by efforts."""

    def __init__(self, made: Node, roster: tuple[str, ...]) -> None:
        self.node, self.tick, self.state, self.paused = made, 0, 1.0, False
        self.truth, self.effort = made.advertise(TRUTH), made.subscribe(EFFORT)
        self.barrier = Barrier(made.transport, made.send_buffer, roster, made.log, made.wait, self.go)

    def go(self) -> StepGrant:
        session, now = self.node.transport.session, self.tick * STEP_NS
        return StepGrant(simulation=session, tick=self.tick, time=now, epoch=0, paused=self.paused)

    def step(self, count: int, latency: int = 0) -> None:
        for _ in range(count):
            self.node.spin_once()
            self.barrier.update()
            if self.tick % 4 == 0:
                self.truth.publish(Float64(data=self.state))
            if self.barrier.due(self.tick * STEP_NS):
                if latency and self.tick:
                    self.barrier.collect_reports(self.tick * STEP_NS)
                self.barrier.grant(self.go(), self.node.publishers)
                if not latency:
                    self.barrier.collect_reports(self.tick * STEP_NS)
                self.node.update_subscribers(self.barrier.watermarks)
                for message, _ in self.effort.messages:
                    self.state = 0.5 * self.state + 0.01 * message.data
            self.tick += 1


ROSTER = {"a": 50.0, "b": 25.0, "c": 10.0}


def _run(connect: Callable[[], Transport], seed: int, latency: int, order: tuple[str, ...]) -> tuple[float, Any]:
    dawdle = random.Random(seed)
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, tuple(f"/{name}" for name in ROSTER))
        members = {name: Member(connect(), name, ROSTER[name], dawdle) for name in order}
        try:
            simulation.barrier.wait_for_members()
            simulation.step(121, latency)
            if latency:
                simulation.barrier.collect_reports(0)  # at this time all are due
            assert all(source.lost == 0 for each in members.values() if each.node for source in each.node.subscribers)
        finally:
            for each in members.values():
                each.stop()
        return simulation.state, {name: members[name].seen for name in sorted(members)}


@pytest.mark.parametrize("latency", [0, 1])
def test_the_same_run_whatever_the_timing_and_the_start_order(connect: Callable[[], Transport], latency: int) -> None:
    first = _run(connect, 1, latency, ("a", "b", "c"))
    second = _run(connect, 2, latency, ("c", "a", "b"))
    assert first == second
    state, seen = first
    assert state != 1.0
    assert [time_ns for time_ns, _, _ in seen["a"]] == [n * 20_000_000 for n in range(31)]
    assert [time_ns for time_ns, _, _ in seen["b"]] == [n * 40_000_000 for n in range(16)]
    assert [time_ns for time_ns, _, _ in seen["c"]] == [n * 100_000_000 for n in range(7)]


def test_what_is_sent_in_a_tick_is_seen_in_the_next(connect: Callable[[], Transport]) -> None:
    _, seen = _run(connect, 3, 0, ("a", "b", "c"))
    said = [len(shared) for _, _, shared in seen["a"]]
    assert said[0] == 0
    assert said[1] == 3
    heard = [len(truth) for _, truth, _ in seen["c"]]
    assert heard[0] == 1
    assert heard[1:] == [5] * 6


@pytest.mark.parametrize(
    ("idle_ms", "stepped_ms"),
    [
        (0, [*range(0, 500, 20)]),
        (60, [0, 20, 80, 120, 180, 220, 280, 320, 380, 420, 480]),
        (10**9, [0, 20, 120, 220, 320, 420]),
    ],
)
def test_who_has_nothing_to_do_steps_at_messages_alone_and_ten_times_a_second(
    connect: Callable[[], Transport], idle_ms: int, stepped_ms: list[int]
) -> None:
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/idle", "/c"))
        members = [Idler(connect(), "idle", idle_ms * 1_000_000), Member(connect(), "c", 10.0, random.Random(1))]
        try:
            simulation.barrier.wait_for_members()
            simulation.step(500_000_000 // STEP_NS)
            seen = members[0].seen
            assert [time_ns // 1_000_000 for time_ns, _, _ in seen] == stepped_ms
            assert [time_ns // 1_000_000 for time_ns, _, said in seen if said] == [20, 120, 220, 320, 420]
        finally:
            for each in members:
                each.stop()


def test_what_is_sent_early_waits_for_its_tick(connect: Callable[[], Transport]) -> None:
    """With latency 1: messages of a member that ends between two of its ticks arrive only at the second."""
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/a",))
        member = Member(connect(), "a", 25, random.Random(0))
        barrier, reached = (
            simulation.barrier,
            lambda: sum(simulation.barrier.watermarks.admitted_upto["effort"].values()),
        )
        try:
            barrier.wait_for_members()
            simulation.step(9, latency=1)
            assert reached() == 1
            (known,) = barrier._members.values()
            wait_until(lambda: barrier.update() or known.answer, what="the end of the second step")
            barrier.collect_reports(12 * STEP_NS)
            assert reached() == 1
            barrier.collect_reports(16 * STEP_NS)
            assert reached() == 2
        finally:
            member.stop()


def test_a_member_that_dies_is_dropped_and_the_run_says_so(connect: Callable[[], Transport]) -> None:
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/a", "/b"))
        alive, dying = (Member(connect(), name, 50, random.Random(0)) for name in ("a", "b"))
        try:
            simulation.barrier.wait_for_members()
            simulation.step(20)
            dying.ended.set()
            simulation.step(40)
            assert simulation.barrier.state.lost == ("/b",)
            assert dying.node is not None
            assert simulation.barrier.watermarks.lost_members == {member_id("/b", dying.node.transport.session)}
            assert alive.seen[-1][0] == 56 * STEP_NS
            assert dying.seen[-1][0] == 20 * STEP_NS
        finally:
            alive.stop()
            dying.stop()


def test_a_member_that_takes_leave_may_be_gone_before_its_tick_is_over(
    connect: Callable[[], Transport], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two ticks, as during a pause: it has finished, and its last messages are received."""
    monkeypatch.setattr("services.runtime.lockstep.barrier.LAST_REPORT_S", 60.0)
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/a", "/b"))
        barrier = simulation.barrier
        staying, leaving = Member(connect(), "a", 50, random.Random(0)), Leaver(connect(), "b")
        try:
            barrier.wait_for_members()
            simulation.step(5, latency=1)
            leaving.thread.join(60)
            wait_until(lambda: barrier.update() or len(barrier._ready) == 1, what="the end of its token")
            simulation.step(20, latency=1)
            assert (barrier.state.left, barrier.state.lost) == (("/b",), ())
            assert [7.0 in shared for _, _, shared in staying.seen[:4]] == [False, True, True, False]
        finally:
            leaving.stop()
            staying.stop()


def test_a_member_that_comes_back_is_waited_for_again(connect: Callable[[], Transport]) -> None:
    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/a",))
        first = Member(connect(), "a", 50, random.Random(0))
        second: Member | None = None
        try:
            simulation.barrier.wait_for_members()
            simulation.step(8)
            first.ended.set()
            simulation.step(8)
            first.stop()
            second = Member(connect(), "a", 50, random.Random(0))

            def stepped() -> bool:
                simulation.step(4)
                return len(second.seen) >= 5 if second else False

            wait_until(stepped)
            times = [time_ns for time_ns, _, _ in second.seen]
            assert [b - a for a, b in pairwise(times)] == [20_000_000] * (len(times) - 1)
        finally:
            first.stop()
            if second is not None:
                second.stop()


@pytest.mark.parametrize("ended", [False, True])
def test_a_step_begins_once_new_subscriptions_have_arrived_or_ended_again(
    connect: Callable[[], Transport], monkeypatch: pytest.MonkeyPatch, ended: bool
) -> None:
    transport, looks = connect(), list[tuple[str, int]]()
    arrived = transport.arrived_tokens

    def arrive_at_the_third_look(pattern: str) -> set[str]:
        looks.append((pattern, len(writer.seen)))
        return arrived(pattern) if len(looks) > 2 and not ended else set()

    monkeypatch.setattr(transport, "arrived_tokens", arrive_at_the_third_look)
    if ended:
        monkeypatch.setattr(transport, "all_tokens", lambda pattern: [])
    with connect() as own, memory_node(MemoryBus(), "sim", transport=own) as made:
        simulation = Simulation(made, ("/a", "/b"))
        writer, reader = Member(transport, "a", 50.0, random.Random(0)), LateReader(connect(), "b")
        try:
            simulation.barrier.wait_for_members()
            simulation.step(25)
        finally:
            writer.stop()
            reader.stop()
    assert len(looks) >= (1 if ended else 3)
    assert set(looks) == {(token_pattern("sub", name="/shared"), 3)}, "it steps once they are there"
    assert [len(heard) for _, _, heard in reader.seen] == [0, 0, 0, 0, 1, 1, 1]
    assert len(writer.seen) == 7


def test_a_rate_must_be_whole_steps() -> None:
    assert period_of(25, lockstep=True) == 40_000_000
    assert period_of(30, lockstep=False) == 33_333_333
    with pytest.raises(BadInput, match="not a whole number of physics steps"):
        period_of(30, lockstep=True)


def test_a_rate_out_of_range_is_refused() -> None:
    for rate in (0.0, -25.0, 1e10, math.inf, math.nan):
        with case(rate), pytest.raises(BadInput, match="out of range: it must be above 0"):
            period_of(rate, lockstep=False)
