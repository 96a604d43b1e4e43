"""Requests that control time: applied only between ticks, and answered at once even while waiting for members."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from messages.base import Message, decoder, encode
from messages.requests import LIST, PAUSE, RESET, RESUME, STEP, Refusal, Request
from messages.simulation import SimTime, Steps
from messages.std import Empty
from models.world import WorldDescription
from services.runtime.errors import Stopped
from services.runtime.lockstep.member import LockstepMember
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.node import Node
from services.runtime.step import STEP_NS
from services.runtime.transport.api import PendingReplies, idle_subscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.sim import time_modes
from services.sim.engines import default_engine, open_world
from services.sim.loop import SimulationLoop
from services.sim.physics.world import World
from services.sim.robot_topics import CONTROL_STEPS
from services.sim.services import SimulationServices
from services.sim.simulation import Simulation
from services.sim.time_modes import MAX_SLEEP_S, Lockstep, RealTime
from tests.harness.memory_node import memory_node
from tests.harness.waiting import wait_until


class LockstepHarness:
    """A simulation's loop in a thread, in lockstep with one member played by the test, due at each control tick."""

    def __init__(self, bus: MemoryBus, node: Node, member: LockstepMember, world: World, latency: int) -> None:
        self.node, self.member = node, member
        self.simulation = Simulation(node, world, 0, real_time=False)
        self.grants: list[tuple[int, int]] = []
        self._lockstep = Lockstep(self.simulation, node, ("/m",), latency)
        self._loop = SimulationLoop(self.simulation, self._lockstep, node)
        SimulationServices(self.simulation, node)
        self._stranger = MemoryTransport(bus)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        rest = idle_subscriber(self.node.transport)
        with suppress(Stopped):
            self._lockstep.begin((), self._loop.apply_requests)
            self._loop.begin()
            while True:
                self._loop.process_requests()
                if self._loop.time_stopped:
                    self._loop.update_while_stopped()
                    self.node.wait(rest)
                else:
                    self._loop.tick()

    def join(self) -> None:
        self.member.join()
        greeting = wait_until(self.member.poll, what="a greeting")
        assert greeting is not None
        self.member.send_join(greeting, {}, {})

    def next_grant(self) -> tuple[int, int]:
        """Wait for the next step grant to the member; return its epoch and tick."""

        def polled() -> StepGrant | None:
            grant = self.member.poll()
            return None if grant is None or grant.paused or grant.roster else grant

        grant = wait_until(polled, what="a grant")
        assert grant is not None
        self.grants.append((grant.epoch, grant.tick))
        return self.grants[-1]

    def finish(self) -> None:
        """Report the member's last granted step as finished."""
        self.member.finish(self.grants[-1][1], {}, {})

    def ask(self, request: Request[Message, Message], message: Message | None = None) -> PendingReplies:
        return self._stranger.query_async(request.name[1:], encode(message or Empty()), 60.0)

    def begin_steps(self, count: int) -> PendingReplies:
        """Request steps, which wait for the member; assert that another request is rejected meanwhile."""
        stepped = self.ask(STEP, Steps(count=count))
        assert refusal(self.ask(STEP, Steps(count=1))) == "another step request is still in progress"
        assert stepped.poll() is None
        return stepped

    def end(self) -> None:
        self.node.stopping = True
        self.node.transport.wake()
        self._thread.join(60)
        assert not self._thread.is_alive()


def reply(pending: PendingReplies) -> SimTime:
    """Wait for the reply and return it."""
    (found,) = wait_until(pending.poll, what="an answer") or ()
    assert found.ok, found.payload
    return decoder(SimTime)(found.payload)


def refusal(pending: PendingReplies) -> str:
    (found,) = wait_until(pending.poll, what="a refusal") or ()
    assert not found.ok
    return decoder(Refusal)(found.payload).reason


@contextmanager
def lockstep(latency: int = 0) -> Iterator[LockstepHarness]:
    bus = MemoryBus()
    with (
        open_world(default_engine(), WorldDescription(), STEP_NS) as world,
        memory_node(bus, "sim") as node,
        memory_node(bus, "m") as other,
    ):
        member = LockstepMember(other.transport, ["/m"], CONTROL_STEPS * STEP_NS)
        made = LockstepHarness(bus, node, member, world, latency)
        try:
            made.join()
            yield made
        finally:
            made.end()


@pytest.mark.parametrize("latency", [0, 1])
def test_a_pause_interrupts_the_wait_for_a_member_that_hangs(latency: int) -> None:
    with lockstep(latency) as at:
        for tick in (0, CONTROL_STEPS, 2 * CONTROL_STEPS):
            assert at.next_grant() == (0, tick)
            if tick < 2 * CONTROL_STEPS:
                at.finish()
        stands = (2 + latency) * CONTROL_STEPS
        wait_until(lambda: at.simulation.tick == stands, what="the tick that waits for the member")
        assert wait_until(at.ask(LIST).poll, what="an answer")[0].ok
        assert not at.simulation.paused
        assert reply(at.ask(PAUSE)) == SimTime(tick=stands, time=stands * STEP_NS)
        assert reply(at.ask(PAUSE)).tick == stands
        stepped = at.begin_steps(3)
        at.finish()
        if latency:
            assert at.next_grant() == (0, stands)
            at.finish()
        assert reply(stepped).tick == stands + 3
        assert reply(at.ask(RESUME)).tick == stands + 3
        assert at.next_grant() == (0, stands + CONTROL_STEPS), "no tick is granted twice"


def test_a_reset_ends_the_steps_and_begins_once_the_member_has_finished() -> None:
    with lockstep() as at:
        assert at.next_grant() == (0, 0)
        assert reply(at.ask(PAUSE)).tick == 0
        stepped = at.begin_steps(1000)
        at.finish()
        assert at.next_grant() == (0, CONTROL_STEPS)
        assert reply(at.ask(RESET)) == reply(stepped) == SimTime(epoch=1)
        reply(at.ask(RESUME))
        assert all(each.paused for each in iter(at.member.poll, None)), "it waits for the step of the time before"
        at.finish()
        assert at.next_grant() == (1, 0)


def test_steps_are_answered_at_their_tick_though_time_goes_on() -> None:
    with lockstep() as at:
        assert at.next_grant() == (0, 0)
        reply(at.ask(PAUSE))
        stepped = at.begin_steps(2 * CONTROL_STEPS)
        assert reply(at.ask(RESUME)).tick == 0
        assert refusal(at.ask(STEP, Steps(count=1))) == "time is running: pause it before stepping"
        at.finish()
        assert at.next_grant() == (0, CONTROL_STEPS)
        assert stepped.poll() is None
        at.finish()
        assert reply(stepped).tick == 2 * CONTROL_STEPS
        assert at.next_grant() == (0, 2 * CONTROL_STEPS)


def test_steps_that_are_under_way_at_the_end_are_refused() -> None:
    with lockstep() as at:
        at.next_grant()
        reply(at.ask(PAUSE))
        stepped = at.begin_steps(1000)
    assert refusal(stepped) == "the process ended before this was done"


class SleepingClock:
    """Wall time that only passes in sleeps; in place of the module ``time``."""

    def __init__(self) -> None:
        self.sleeps: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.sleeps.append(seconds)

    def monotonic(self) -> float:
        return sum(self.sleeps)


def test_a_tick_at_a_tiny_factor_waits_in_pieces_and_ends_early_at_a_larger_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = SleepingClock()
    monkeypatch.setattr(time_modes, "time", clock)
    with (
        open_world(default_engine(), WorldDescription(), STEP_NS) as world,
        memory_node(MemoryBus(), "sim") as node,
    ):
        simulation = Simulation(node, world, 0)
        real = RealTime(simulation, node, 1e-6)
        loop = SimulationLoop(simulation, real, node)
        assert all(loop.tick() for _ in range(CONTROL_STEPS))
        for _ in range(3):
            loop.process_requests()
            assert not loop.tick(), "the loop serves requests and heartbeats"
        assert clock.sleeps == [MAX_SLEEP_S] * 3
        real.set_factor(1.0)
        assert loop.tick()
        assert simulation.tick == CONTROL_STEPS + 1
