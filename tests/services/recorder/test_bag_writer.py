"""The order of recorded messages, also of those that arrive after the last tick, is that of their sending."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from messages.geometry import Twist
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, CMD_VEL
from services.bag.reader import open_bag
from services.bag.writer import BagWriter
from services.recorder import RecorderParameters
from services.recorder.bag_recorder import BagRecorder
from services.recorder.subscriptions import Subscriptions, TopicFilter
from services.runtime.node import Node
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node
from tests.harness.waiting import wait_until


@contextmanager
def taping(folder: Path) -> Iterator[tuple[Node, Node, BagRecorder]]:
    """A sending node, a receiving one, and a recorder of the clock and a command that it receives."""
    bus = MemoryBus()
    with memory_node(bus, "simulation") as sender, memory_node(bus, "recorder") as taker, BagWriter(folder) as bag:
        sender.advertise(CLOCK)
        sender.advertise(CMD_VEL, "/r/cmd_vel")
        listening = Subscriptions(taker, TopicFilter(RecorderParameters(), taker.identity.resolve))
        listening.subscribe_existing()
        yield sender, taker, BagRecorder(bag, listening, taker.log)


def test_a_command_that_overtakes_the_clock_has_the_time_before_which_it_was_sent(tmp_path: Path) -> None:
    with taping(tmp_path / "bag") as (sender, taker, tape):
        clock, command = sender.advertise(CLOCK), sender.advertise(CMD_VEL, "/r/cmd_vel")

        def take(end: bool = False) -> int:
            taker.update_subscribers()
            tape.record(end)
            return tape.now

        clock.publish(Clock(clock=Time.of(20_000_000)))
        wait_until(lambda: take() == 20_000_000, what="the first clock")
        sender.send_buffer.begin()
        clock.publish(Clock(clock=Time.of(40_000_000)))
        command.publish(Twist.planar(0.1, 0.0))
        assert take() == 20_000_000, "the command is there, the clock before it is not"
        sender.send_buffer.flush()
        wait_until(lambda: take() == 40_000_000, what="the second clock")
        command.publish(Twist.planar(0.2, 0.0))
        take(end=True)
        tape.close()
    assert times(tmp_path / "bag") == [40_000_000, 40_000_000]


def test_what_comes_after_the_last_tick_has_the_time_at_which_it_was_sent(tmp_path: Path) -> None:
    """Other nodes went on without the recorder; such messages get times 1 ns after a step: none counted in the run."""
    with taping(tmp_path / "bag") as (sender, taker, tape):
        clock, command = sender.advertise(CLOCK), sender.advertise(CMD_VEL, "/r/cmd_vel")
        for ms in (20, 40, 60, 80):
            clock.publish(Clock(clock=Time.of(ms * 1_000_000)))
            command.publish(Twist.planar(0.1, 0.0))
        taker.update_subscribers()
        tape.record_remaining(40_000_000)
        tape.close()
    assert times(tmp_path / "bag") == [40_000_001, 40_000_001, 60_000_001, 80_000_001]


def times(folder: Path) -> list[int]:
    """Return the publish times of the commands in a bag [ns, simulation time]."""
    return [each.publish_time for each in open_bag(folder).entries() if each.channel.topic == "/r/cmd_vel"]
