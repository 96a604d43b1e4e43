"""A bag played beside a simulation follows its time from the moment at which playback starts."""

from __future__ import annotations

from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK
from services.bag.reader import BagTime
from services.player.clocks import SimClock
from services.runtime.context import Context
from services.runtime.parameters.base import Parameters
from services.runtime.publisher import Publisher
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node

SECOND = 10**9


def tell(out: Publisher[Clock], start: int, end: int, epoch: int = 0) -> None:
    """Publish the clock from one second to another, at 10 Hz."""
    for tenth in range(start * 10, end * 10 + 1):
        out.publish(Clock(clock=Time.of(tenth * SECOND // 10), epoch=epoch))


def test_time_that_passed_before_the_bag_began_is_none_of_its_time() -> None:
    with memory_node(MemoryBus(), "player") as player:
        pace = SimClock(Context(player, Parameters(), None), 1.0)
        out = player.advertise(CLOCK)
        tell(out, 0, 50)  # while waiting for subscribers
        pace.start()
        pace.wait_until(BagTime(0, 0, 0))
        tell(out, 50, 53)
        pace.wait_until(BagTime(3 * SECOND, 0, 0))
        assert pace.elapsed == 3 * SECOND
        tell(out, 0, 2, epoch=1)  # a reset doesn't rewind playback
        pace.wait_until(BagTime(5 * SECOND, 0, 0))
        assert pace.elapsed == 5 * SECOND
        pace.start()
        tell(out, 2, 3, epoch=1)
        pace.wait_until(BagTime(SECOND, 0, 0))
        assert pace.elapsed == 0, "the first moment is the beginning, whatever it is called"
