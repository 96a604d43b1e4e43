"""The observers' clock on an in-memory bus: the simulation time of an instant, or None where it is unknown."""

from __future__ import annotations

import struct

import pytest

from deploy.live.subscribers import ClockSubscriber
from messages.base import encode
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import encoding

TICK = 20_000_000
"""Time between two clock messages [ns], on the simulation clock and, in these tests, on the wall clock."""


class ClockPublisher:
    """An observer's clock and a publisher for it."""

    def __init__(self, bus: MemoryBus) -> None:
        self.clock = ClockSubscriber(MemoryTransport(bus))
        self._out = MemoryTransport(bus).advertise("clock", encoding(Clock.ROS_TYPE), CLOCK.quality)

    def tell(self, number: int, epoch: int = 0, off: int = 0) -> None:
        """Publish clock number ``number``, sent at that tick of the wall clock plus ``off`` [ns]."""
        message = Clock(clock=Time.of(number * TICK), epoch=epoch)
        beside = struct.pack("<qqB16s", number, number * TICK + off, 16, b"simulation")
        self._out.put(encode(message), attachment=beside)
        self.clock.update()


@pytest.fixture
def published_clock() -> ClockPublisher:
    return ClockPublisher(MemoryBus())


def test_a_moment_has_the_time_of_the_last_clock_before_it(published_clock: ClockPublisher) -> None:
    for number in range(1, 5):
        published_clock.tell(number)
    assert published_clock.clock.time_at(TICK - 1) is None
    assert [published_clock.clock.time_at(round(each * TICK)) for each in (1, 1.9, 2, 4.5)] == [
        TICK,
        TICK,
        2 * TICK,
        4 * TICK,
    ]
    assert published_clock.clock.covers(4 * TICK - 1)
    assert not published_clock.clock.covers(4 * TICK)


def test_where_a_clock_was_lost_the_time_is_not_known(published_clock: ClockPublisher) -> None:
    for number in (1, 2, 4, 5):
        published_clock.tell(number)
    assert [published_clock.clock.time_at(round(each * TICK)) for each in (1.5, 2, 2.5, 3.5)] == [
        TICK,
        None,
        None,
        None,
    ]
    assert published_clock.clock.time_at(round(4.5 * TICK)) == 4 * TICK
    assert published_clock.clock.now == 5 * TICK


def test_time_that_begins_anew_forgets_what_was_before(published_clock: ClockPublisher) -> None:
    published_clock.tell(8)
    published_clock.tell(10, epoch=1)
    assert published_clock.clock.time_at(9 * TICK) is None
    assert published_clock.clock.time_at(11 * TICK) == 10 * TICK


HOUR = 3600 * 10**9


@pytest.mark.parametrize("off", [-TICK // 2, -5 * TICK, -HOUR, HOUR])
def test_it_is_right_again_with_the_first_clock_after_the_wall_clock_was_set(
    published_clock: ClockPublisher, off: int
) -> None:
    for number in range(1000, 1010):
        published_clock.tell(number)
    for number in range(1010, 1015):
        published_clock.tell(number, off=off)
        assert published_clock.clock.time_at(number * TICK + off) == number * TICK
        assert published_clock.clock.covers(number * TICK + off - 1)
        assert published_clock.clock.now == number * TICK


@pytest.mark.parametrize("off", [-HOUR, HOUR])
def test_a_wrong_stamp_costs_nothing_after_the_next_clock(published_clock: ClockPublisher, off: int) -> None:
    for number in range(1000, 1010):
        published_clock.tell(number, epoch=1)
    published_clock.tell(1010, epoch=2, off=off)
    for number in range(1011, 1015):
        published_clock.tell(number, epoch=2)
        assert published_clock.clock.time_at(number * TICK) == number * TICK
        assert published_clock.clock.covers(number * TICK - 1)
        assert not published_clock.clock.covers(number * TICK)
        assert published_clock.clock.since <= number * TICK, "samples of the new epoch count as such"
