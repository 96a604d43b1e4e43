"""Nodes that share a process: the same run as in separate processes, calls among them, and how they end."""

from __future__ import annotations

import io
import random
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.names import Identity
from messages.requests import Done, Name, Request
from messages.std import Float64
from messages.topics import CMD_VEL
from services.runtime.composition.container import Container, NodeFailed
from services.runtime.context import Context, MakePacer
from services.runtime.errors import BadInput, NoAnswer
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import ManualClock, memory_node
from tests.harness.waiting import wait_until
from tests.services.runtime.lockstep.test_lockstep import EFFORT, SHARED, TRUTH, Member, Simulation

RATE = 50.0
ASK = Request("ask", Name, Done, "what one node asks another")

Run = Callable[[Context[Any]], None]


class Running:
    """A container in a thread; ``error`` is the exception that it raised."""

    def __init__(self, transport: Transport, loops: dict[str, Run], lockstep: bool, rate: float | None = RATE) -> None:
        self.error: NodeFailed | None = None
        self.container = Container(transport.__enter__())
        for name, run in loops.items():
            identity = Identity.of(name.rpartition("/")[2], f"/{name.rpartition('/')[0]}")
            log = Log(identity.node, out=io.StringIO())
            self.container.add(identity, "test", log, self._loop(run, rate, lockstep), lockstep)
        self.thread = threading.Thread(target=self._body, args=(transport,))
        self.thread.start()

    def stop(self) -> None:
        self.container.stop()
        self.thread.join(60)
        assert not self.thread.is_alive()

    def _body(self, transport: Transport) -> None:
        try:
            self.container.run()
        except NodeFailed as error:
            self.error = error
        finally:
            transport.close()

    @staticmethod
    def _loop(run: Run, rate: float | None, lockstep: bool) -> Callable[[Node, MakePacer | None], None]:
        def loop(node: Node, make_pacer: MakePacer | None) -> None:
            run(Context(node, Parameters(), rate, lockstep, make_pacer=make_pacer))

        return loop


@contextmanager
def running(transport: Transport, loops: dict[str, Run], lockstep: bool = True) -> Iterator[Running]:
    made = Running(transport, loops, lockstep)
    try:
        yield made
    finally:
        made.stop()


Seen = list[tuple[int, tuple[float, ...], tuple[float, ...]]]


def mixer(name: str, seen: Seen) -> Run:
    """Return the loop of the lockstep tests' ``Member``, without its pauses."""

    def run(ctx: Context[Any]) -> None:
        truth, shared = ctx.stream(TRUTH), ctx.stream(SHARED)
        value = 0.0
        for tick in ctx.ticks():
            heard, said = (tuple(m.data for m in each.drain()) for each in (truth, shared))
            seen.append((tick.time, heard, said))
            value = 0.9 * value + sum(heard) + 0.1 * sum(said)
            ctx.publish(SHARED, Float64(data=value))
            ctx.publish(EFFORT, Float64(data=value + len(name)))

    return run


def _run(connect: Callable[[], Transport], latency: int, groups: list[list[str]]) -> tuple[float, dict[str, Seen]]:
    """Return the simulation's state and the nodes' observations after 81 steps; a group of one is its own process."""
    seen: dict[str, Seen] = {}
    with ExitStack() as stack:
        made = stack.enter_context(memory_node(MemoryBus(), "sim", transport=stack.enter_context(connect())))
        simulation = Simulation(made, tuple(f"/{name}" for group in groups for name in group))
        for group in groups:
            if len(group) == 1:
                member = Member(connect(), group[0], RATE, random.Random(1))
                stack.callback(member.stop)
                seen[group[0]] = member.seen
            else:
                seen |= {name: [] for name in group}
                stack.enter_context(running(connect(), {name: mixer(name, seen[name]) for name in group}))
        simulation.barrier.wait_for_members()
        simulation.step(81, latency)
        if latency:
            simulation.barrier.collect_reports(0)
        assert set(simulation.barrier.state.members) == {f"/{name}" for name in seen}
        return simulation.state, seen


@pytest.mark.parametrize("latency", [0, 1])
def test_the_run_is_that_of_separate_processes(connect: Callable[[], Transport], latency: int) -> None:
    apart = _run(connect, latency, [["a"], ["bb"], ["ccc"]])
    assert [len(said) for _, _, said in apart[1]["a"][:3]] == [0, 3, 3]
    assert _run(connect, latency, [["ccc", "a", "bb"]]) == apart
    assert _run(connect, latency, [["bb", "a"], ["ccc"]]) == apart


def test_a_call_to_a_node_of_the_same_process_is_answered_after_its_own_tick(
    connect: Callable[[], Transport],
) -> None:
    ticks, answers = [], []

    def client(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            answers.append((tick.time, ctx.call(ASK, Name(name="x"), timeout=60.0).text))

    def server(ctx: Context[Any]) -> None:
        ctx.serve(ASK, lambda asked: Done(text=f"{asked.name}{ticks[-1]}"))
        for tick in ctx.ticks():
            ticks.append(tick.time)

    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/client", "/server"))
        with running(connect(), {"client": client, "server": server}):
            simulation.barrier.wait_for_members()
            simulation.step(41)
    assert ticks == [n * 20_000_000 for n in range(11)]
    assert answers == [(time, f"x{time}") for time in ticks]


def test_a_node_that_ends_leaves_and_the_others_go_on(connect: Callable[[], Transport]) -> None:
    seen: Seen = []

    def short(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            ctx.publish(SHARED, Float64(data=1.0))
            if tick.time == 40_000_000:
                return

    with connect() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        simulation = Simulation(made, ("/short", "/long"))
        with running(connect(), {"short": short, "long": mixer("long", seen)}):
            simulation.barrier.wait_for_members()
            simulation.step(41)
            assert (simulation.barrier.state.members, simulation.barrier.state.left) == (("/long",), ("/short",))
            wait_until(lambda: not transport.tokens("@elea/*/node/%short/*/*/*") or None)
    assert [len(said) for _, _, said in seen] == [0, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1]


def test_commands_leave_together_and_before_the_report() -> None:
    bus, left = MemoryBus(), []
    effort = MemoryTransport(bus).subscribe("effort", 8)

    def commander(ctx: Context[Any]) -> None:
        for _ in ctx.ticks():
            ctx.publish(EFFORT, Float64(data=1.0))
            left.append(len(effort.samples))

    with memory_node(bus, "sim", transport=MemoryTransport(bus)) as made:
        simulation = Simulation(made, ("/one", "/other"))
        with running(MemoryTransport(bus), {"one": commander, "other": commander}):
            simulation.barrier.wait_for_members()
            simulation.step(5)
            assert left == [0, 0, 2, 2]
            assert len(effort.samples) == 4


def test_when_one_fails_the_others_end_in_an_orderly_way() -> None:
    bus, stopped = MemoryBus(), []
    clock = ManualClock(bus)

    def good(ctx: Context[Any]) -> None:
        try:
            for _ in ctx.ticks():
                pass
        finally:
            ctx.publish(CMD_VEL, Twist())
            stopped.append(ctx.node_name)

    def bad(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            if tick.time:
                raise KeyError("a")

    with running(MemoryTransport(bus), {"r0/good": good, "r1/bad": bad, "r2/good": good}, lockstep=False) as made:
        wait_until(lambda: sum("/step/" in key for key in list(bus.tokens)) == 3)
        clock.publish(20_000_000)
        made.thread.join(60)
    assert isinstance(made.error, NodeFailed)
    assert (made.error.node, type(made.error.error)) == ("/r1/bad", KeyError)
    assert sorted(stopped) == ["/r0/good", "/r2/good"]
    assert not any("/node/" in key for key in bus.tokens)


def test_nodes_of_one_process_have_one_rate_in_lockstep() -> None:
    def fast(ctx: Context[Any]) -> None:
        list(ctx.ticks(100.0))

    def slow(ctx: Context[Any]) -> None:
        list(ctx.ticks())

    with running(MemoryTransport(MemoryBus()), {"fast": fast, "slow": slow}) as made:
        made.thread.join(60)
    assert isinstance(made.error, NodeFailed)
    assert isinstance(made.error.error, BadInput)
    assert "/slow ticks at 50 Hz and /fast at 100 Hz" in str(made.error)


def test_a_call_that_waits_for_its_reply_holds_up_nobody() -> None:
    """The others keep ticking while one waits for its reply; each publishes on one key, under its own name."""
    bus = MemoryBus()
    clock, counted, ended = ManualClock(bus), [0], threading.Event()
    server = MemoryTransport(bus).serve("ask")

    def caller(ctx: Context[Any]) -> None:
        assert ctx.call(ASK, Name(), timeout=60.0) == Done(text="late")
        with pytest.raises(NoAnswer):
            ctx.call(ASK, Name(), timeout=0.1)
        ended.set()
        list(ctx.ticks())

    def counter(ctx: Context[Any]) -> None:
        for _ in ctx.ticks():
            counted[0] += 1

    with running(MemoryTransport(bus), {"caller": caller, "counter": counter}, lockstep=False):
        wait_until(lambda: any("/step/" in key for key in list(bus.tokens)))
        for number in range(5):
            clock.publish(number * 20_000_000)
            wait_until(lambda number=number: counted[0] == number + 1)
        query = wait_until(server.recv)
        assert query is not None
        assert server.recv() is None, "it still waits for its first reply"
        query.reply(encode(Done(text="late")))
        wait_until(ended.is_set)
