"""The new simulation's time is not behind the old one's when a controller hears of it."""

from __future__ import annotations

from messages.base import encode
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, Quality
from services.runtime.graph import Entity
from services.runtime.pacing import ClockPacer, Instant
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import encoding, pack_attachment, publisher_id
from tests.harness.memory_node import memory_node

PERIOD_NS = 40_000_000


def test_another_clock_is_another_simulation_once_the_one_before_is_gone() -> None:
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
