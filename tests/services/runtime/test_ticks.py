"""A service's loop on the in-memory transport: ticks, snapshots, freshness, reset, pause, end."""

from __future__ import annotations

import io
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from itertools import count
from typing import Any

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.nav import Odometry
from messages.rosgraph import Clock
from messages.std import Header, Time
from messages.topics import CLOCK, CMD_VEL, HEALTH, ODOM, Quality
from services.runtime import pacing
from services.runtime.context import Context, Tick
from services.runtime.errors import BadInput, Stopped
from services.runtime.fleet_instances import FleetInstance
from services.runtime.graph import Entity
from services.runtime.log import Log
from services.runtime.pacing import ClockPacer, ClockWatchdog, Instant
from services.runtime.parameters.base import Parameters
from services.runtime.subscriber import QUEUE_SIZE, Subscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import encoding, pack_attachment, publisher_id
from tests.harness.memory_node import ManualClock, loop_has_begun, memory_node
from tests.harness.waiting import wait_until

MS = 1_000_000
PERIOD_NS = 40 * MS


class OdometryPublisher:
    """Publishes odometry on request."""

    def __init__(self, bus: MemoryBus) -> None:
        self._outlet = MemoryTransport(bus).advertise("tb3_0/odom", encoding(Odometry.ROS_TYPE), Quality.SENSOR)
        self._sent = 0

    def put(self, ns: int) -> None:
        self._sent += 1
        self._outlet.put(
            encode(Odometry(header=Header(stamp=Time.of(ns)))), attachment=pack_attachment(self._sent, b"o" * 16)
        )


@contextmanager
def running(bus: MemoryBus, run: Callable[[Context[Any]], None], rate: float = 25) -> Iterator[Context[Any]]:
    """Run the loop in a thread, from when it reads its inputs until the end. An exception in it fails the test."""
    waiter = memory_node(bus, "waypoint", "/tb3_0")
    with waiter:
        ctx: Context[Any] = Context(waiter, Parameters(), rate)

        def body() -> None:
            with suppress(Stopped):
                run(ctx)

        thread = threading.Thread(target=body)
        thread.start()
        try:
            wait_until(lambda: loop_has_begun(waiter), what="a loop that reads its inputs")
            yield ctx
        finally:
            waiter.stopping = True
            waiter.transport.wake()
            thread.join(60)
            assert not thread.is_alive()


def test_ticks_follow_the_clock_at_the_rate(bus: MemoryBus, clock: ManualClock) -> None:
    ticks: list[Tick] = []

    def run(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            ticks.append(tick)

    with running(bus, run):
        for number in range(11):
            clock.publish(number * 20 * MS)
            wait_until(lambda n=number: len(ticks) >= n // 2 + 1)
    assert [tick.time for tick in ticks] == [n * 40 * MS for n in range(6)]
    assert [tick.dt for tick in ticks] == [0.0] + [0.04] * 5
    assert not any(tick.reset for tick in ticks)


def test_what_was_missed_is_not_made_up_for(bus: MemoryBus, clock: ManualClock) -> None:
    ticks: list[Tick] = []

    def run(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            ticks.append(tick)

    with running(bus, run):
        for time_ns in (0, 500 * MS, 520 * MS):
            clock.publish(time_ns)
            wait_until(lambda t=time_ns: ticks and (ticks[-1].time == t))
    assert [tick.time for tick in ticks] == [0, 500 * MS, 520 * MS]


def test_ticks_that_a_late_node_does_not_take_are_counted(bus: MemoryBus, clock: ManualClock) -> None:
    """Held up in its first tick, it finds several clock messages: all due ticks but the newest are missed."""
    ticks: list[int] = []
    go_on = threading.Event()

    def run(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            ticks.append(tick.time // MS)
            if len(ticks) == 1:
                go_on.wait(60)

    with running(bus, run) as ctx:
        clock.publish(0)
        wait_until(lambda: ticks == [0])
        for time_ms in (20, 40, 60, 80, 100):
            clock.publish(time_ms * MS)
        go_on.set()
        wait_until(lambda: ticks == [0, 100])
        assert ctx.node.heartbeat.missed == 1, "that of 40 ms; the one of 80 ms came late"
        for time_ms in (120, 140, 160):
            clock.publish(time_ms * MS)
            wait_until(lambda t=time_ms: ticks[-1] == t - t % 40)
        assert ctx.node.heartbeat.missed == 1
        clock.publish(1000 * MS)
        wait_until(lambda: ticks[-1] == 1000)
        assert ctx.node.heartbeat.missed == 1, "a clock that leaps is not its fault"


def test_a_tick_sees_one_instant_and_freshness_is_simulation_time(bus: MemoryBus, clock: ManualClock) -> None:
    seen: list[tuple[float, bool, bool]] = []
    odom = OdometryPublisher(bus)

    def run(ctx: Context[Any]) -> None:
        here = ctx.latest(ODOM)
        for _ in ctx.ticks():
            seen.append((here.age, here.fresh(0.5) is not None, here.value is not None))

    with running(bus, run):
        clock.publish(0)
        wait_until(lambda: len(seen) == 1)
        odom.put(40 * MS)
        clock.publish(80 * MS)
        wait_until(lambda: len(seen) == 2)
        clock.publish(640 * MS)
        wait_until(lambda: len(seen) == 3)
    assert seen == [(float("inf"), False, False), (0.04, True, True), (0.6, False, True)]


def test_a_new_epoch_is_a_reset_and_empties_the_inputs(bus: MemoryBus, clock: ManualClock) -> None:
    seen: list[tuple[int, bool, float, bool]] = []
    odom = OdometryPublisher(bus)

    def run(ctx: Context[Any]) -> None:
        here = ctx.latest(ODOM)
        for tick in ctx.ticks():
            seen.append((tick.time, tick.reset, tick.dt, here.value is not None))

    with running(bus, run):
        odom.put(0)
        clock.publish(1000 * MS)
        wait_until(lambda: len(seen) == 1)
        clock.publish(0, epoch=1)
        wait_until(lambda: len(seen) == 2)
        clock.publish(40 * MS, epoch=1)
        wait_until(lambda: len(seen) == 3)
    assert seen == [(1000 * MS, False, 0.0, True), (0, True, 0.0, False), (40 * MS, False, 0.04, False)]


def test_a_simulation_that_starts_anew_is_a_reset_too(bus: MemoryBus, clock: ManualClock) -> None:
    seen: list[tuple[int, bool, float]] = []

    def run(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            seen.append((tick.time, tick.reset, tick.dt))

    with running(bus, run):
        clock.publish(5000 * MS)
        wait_until(lambda: len(seen) == 1)
        clock.publish(0)
        wait_until(lambda: len(seen) == 2)
    assert seen[1] == (0, True, 0.0)


def test_a_paused_clock_gives_no_ticks_and_shows(bus: MemoryBus, clock: ManualClock) -> None:
    states: list[str] = []

    def run(ctx: Context[Any]) -> None:
        for _ in ctx.ticks():
            states.append(ctx.node.heartbeat.state)

    with running(bus, run) as ctx:
        clock.publish(0)
        wait_until(lambda: len(states) == 1)
        clock.publish(0, paused=True)
        wait_until(lambda: ctx.node.heartbeat.state == "paused")
        clock.publish(40 * MS)
        wait_until(lambda: len(states) == 2)
    assert states == ["running", "running"]


def test_without_a_clock_the_node_says_that_it_waits(bus: MemoryBus) -> None:
    def run(ctx: Context[Any]) -> None:
        for _ in ctx.ticks():
            raise AssertionError("a tick without a clock")

    with running(bus, run) as ctx:
        wait_until(lambda: (ctx.node.heartbeat.state, ctx.node.heartbeat.detail) == ("waiting", "no clock"))


def test_a_node_that_is_early_does_not_take_its_own_fleet_for_another_one(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other running fleets are named only if the node has joined none: a supervisor is up before the clock."""
    own = FleetInstance(fleet="own", mode="real", port=1, pid=1, folder="", started="")
    monkeypatch.setattr(pacing, "running_fleets", lambda: (own,))
    told = []
    for joined in (False, True):
        node, log = memory_node(bus, "early"), io.StringIO()
        node.clock_patience_s = 0.0
        watchdog = ClockWatchdog(node, Log("/early", out=log))
        with memory_node(bus, "supervisor") if joined else nullcontext():
            watchdog.check()
        told.append(log.getvalue())
    assert "no clock for" in told[0]
    assert "Fleets that run here: own (port 1); ./elea run --port joins one of them" in told[0]
    assert "no clock for" in told[1]
    assert "s: the fleet is still starting, or its simulation has ended: ./elea ps shows its processes" in told[1]
    assert "own" not in told[1]


def test_publish_refuses_another_record(bus: MemoryBus) -> None:
    with memory_node(bus, "a") as made:
        ctx: Context[Any] = Context(made, Parameters(), 25)
        with pytest.raises(TypeError, match="carries Twist, not Odometry"):
            ctx.publish(CMD_VEL, Odometry())  # type: ignore[arg-type]
        ctx.publish(CMD_VEL, Twist())
        assert [each.sent for each in made.publishers if each.name == "/cmd_vel"] == [1]


def test_a_service_without_a_rate_has_no_ticks(bus: MemoryBus) -> None:
    with memory_node(bus, "a") as made, pytest.raises(BadInput, match="without a rate"):
        next(iter(Context(made, Parameters(), None).ticks()))


def test_a_rate_of_zero_does_not_mean_the_declared_one(bus: MemoryBus) -> None:
    with memory_node(bus, "a") as made, pytest.raises(BadInput, match="a rate of 0 Hz is out of range"):
        next(iter(Context(made, Parameters(), 25).ticks(0)))


def test_messages_are_answered_as_they_come(bus: MemoryBus) -> None:
    odom, seen = OdometryPublisher(bus), []

    def run(ctx: Context[Any]) -> None:
        for message in ctx.messages(ODOM):
            seen.append(message.header.stamp.ns)

    with running(bus, run):
        for stamp in (1, 2, 3):
            odom.put(stamp)
        wait_until(lambda: len(seen) == 3)
    assert seen == [1, 2, 3]


def test_a_second_clock_is_counted_and_not_followed_until_the_first_is_silent(
    bus: MemoryBus, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As from an older bag player or a second simulation, which must not reset every node 50 times a second."""
    monkeypatch.setattr("services.runtime.pacing.CLOCK_SILENCE_S", 3600.0)
    ticks: list[Tick] = []

    def run(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            ticks.append(tick)

    with running(bus, run, rate=50) as ctx, memory_node(bus, "player") as player:
        other = player.advertise(CLOCK)

        def tell(number: int) -> None:
            clock.publish((1000 + 20 * number) * MS)
            other.publish(Clock(clock=Time.of(20 * number * MS)))

        # The first, which has no token, gives way to a node's clock once and for good.
        for number in range(20):
            tell(number)
            wait_until(lambda n=number: ticks and ticks[-1].time == 20 * n * MS)
        assert [tick.reset for tick in ticks].count(True) <= 1
        (counts,) = [each for each in ctx.node.refusal_counters if each.refused]
        assert (counts.name, counts.refused) == ("pacing: /clock", 19)
        assert counts.reason == "a publisher without a token publishes a different time from /player"
        with memory_node(bus, "sim") as sim:
            mine = sim.advertise(CLOCK)
            for number in range(20, 40):
                tell(number)
                mine.publish(Clock(clock=Time.of((5000 + 20 * number) * MS)))
                wait_until(lambda n=number: ticks[-1].time == (5000 + 20 * n) * MS)
            assert [tick.reset for tick in ticks].count(True) <= 2, "the simulation's is preferred"
            sim.unregister(mine)
            tell(40)
            wait_until(lambda: ticks[-1].time == 800 * MS, what="the other one, as the simulation's token is gone")
        monkeypatch.setattr("services.runtime.pacing.CLOCK_SILENCE_S", 0.05)

        def silent() -> bool:
            clock.publish(9000 * MS)
            return ticks[-1].time == 9000 * MS and ctx.node.heartbeat.state == "running"

        wait_until(silent, what="the first one again, as the other is silent")


def test_the_clock_of_a_stranger_is_in_the_health(bus: MemoryBus, clock: ManualClock) -> None:
    beats: list[Any] = []
    with running(bus, lambda ctx: [None for _ in ctx.ticks()]) as ctx, memory_node(bus, "witness") as witness:
        health, other = witness.subscribe(HEALTH), ManualClock(bus, b"d" * 16)

        def heard() -> list[Any]:
            clock.publish(1000 * MS)
            other.publish(0)
            ctx.node.heartbeat.request_now()
            witness.update_subscribers()
            beats.extend(message for message, _ in health.messages)
            return [each for beat in beats for each in beat.inputs if each.topic == "pacing: /clock"]

        assert wait_until(heard)[0].refused > 0


def test_another_clock_is_another_simulation_once_the_one_before_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.pacing.CLOCK_SILENCE_S", 3600.0)
    bus = MemoryBus()
    outlet = MemoryTransport(bus).advertise(CLOCK.name[1:], encoding(Clock.ROS_TYPE), Quality.SENSOR)
    with memory_node(bus, "listener") as listener:
        pacer = ClockPacer(listener, PERIOD_NS)

        def told(ns: int, simulation: MemoryTransport) -> Instant | None:
            publisher = publisher_id("/sim", simulation.session, CLOCK.name[1:])
            outlet.put(encode(Clock(clock=Time.of(ns))), attachment=pack_attachment(1, publisher))
            return pacer.next()

        old, new = MemoryTransport(bus), MemoryTransport(bus)
        token = old.declare_token(Entity(old.session, "pub", "/sim", CLOCK.name, Clock.ROS_TYPE, "SENSOR").key)
        first, second = told(0, old), told(PERIOD_NS, old)
        assert first is not None
        assert second is not None
        assert second.simulation == first.simulation
        assert told(2 * PERIOD_NS, new) is None, "two at a time: the first one tells it"
        token.close()
        third = told(2 * PERIOD_NS, new)
        assert third is not None
        assert third.simulation != second.simulation
        fourth = told(3 * PERIOD_NS, new)
        assert fourth is not None
        assert fourth.simulation == third.simulation


def test_an_input_gives_what_its_ring_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    source = Subscriber(CMD_VEL, "/cmd_vel", "cmd_vel", MemoryTransport(MemoryBus()))
    numbers, sender = count(1), publisher_id("/a", "1", "cmd_vel")
    payload = encode(Twist())
    monkeypatch.setattr(source.raw, "key", lambda _: "cmd_vel")
    monkeypatch.setattr(source.raw, "encoding", lambda _: "")
    monkeypatch.setattr(source.raw, "recv", lambda: (payload, pack_attachment(next(numbers), sender), None))
    source.update()
    assert len(source.messages) == source.received == QUEUE_SIZE
    source.update()
    assert (source.received, source.lost) == (2 * QUEUE_SIZE, 0)


def test_a_flood_of_clocks_gives_a_tick() -> None:
    with memory_node(MemoryBus(), "a") as made:
        pacer = ClockPacer(made, 20_000_000)
        payload = encode(Clock())
        pacer.raw.recv = lambda: (payload, b"", None)  # type: ignore[method-assign]
        pacer.raw.key = lambda _: "clock"  # type: ignore[method-assign]
        pacer.raw.encoding = lambda _: ""  # type: ignore[method-assign]
        instant = pacer.next()
    assert instant is not None
    assert instant.time == 0
