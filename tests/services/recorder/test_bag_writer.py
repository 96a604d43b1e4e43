"""The order of recorded messages, also of those that arrive after the last tick, is that of their sending; none is
missing at the end."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from messages.gazebo import LinkStates
from messages.geometry import Twist
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, CMD_VEL, LINK_STATES
from services.bag.info import lost_messages
from services.bag.reader import open_bag
from services.bag.writer import BagWriter
from services.recorder import SERVICE, RecorderParameters
from services.recorder.bag_recorder import BagRecorder
from services.recorder.subscriptions import Subscriptions, TopicFilter
from services.runtime.context import Context
from services.runtime.errors import Stopped
from services.runtime.node import Node
from services.runtime.pacing import Instant
from services.runtime.publisher import Publisher
from services.runtime.transport.api import idle_subscriber
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
    """Messages of steps that the recorder did not take get times 1 ns after a step: none counted in the run."""
    with taping(tmp_path / "bag") as (sender, taker, tape):
        clock, command = sender.advertise(CLOCK), sender.advertise(CMD_VEL, "/r/cmd_vel")
        for ms in (20, 40, 60, 80):
            clock.publish(Clock(clock=Time.of(ms * 1_000_000)))
            command.publish(Twist.planar(0.1, 0.0))
        taker.update_subscribers()
        tape.record_remaining(40_000_000)
        tape.close()
    assert times(tmp_path / "bag") == [40_000_001, 40_000_001, 60_000_001, 80_000_001]


STEP_NS = 40_000_000
STEPS = 3


class LockstepWithoutOthers:
    """A pacer whose simulation publishes at each of its steps, once more before it waits for the recorder, and 100
    steps as soon as it waits no longer."""

    def __init__(self, node: Node, links: Publisher[LinkStates]) -> None:
        self.raw, self.watermarks = idle_subscriber(node.transport), None
        self._node, self._links = node, links
        self._steps = 0

    def start(self) -> None:
        pass

    def next(self) -> Instant | None:
        if self._node.stopping:
            return None
        self._links.publish(LinkStates())
        if self._steps == STEPS:
            self._node.stopping = True
            return None
        self._steps += 1
        return Instant(self._steps * STEP_NS, 0, "simulation")

    def finish(self) -> None:
        pass

    def close(self) -> None:
        for _ in range(100):
            self._links.publish(LinkStates())


def test_a_bag_lacks_nothing_though_the_others_go_on_once_the_recorder_has_left(tmp_path: Path) -> None:
    """Large topics have short queues: 16 messages of this one, which a simulation at full speed fills in 0.2 s."""
    bus, folder = MemoryBus(), tmp_path / "bag"
    with memory_node(bus, "simulation") as sender, memory_node(bus, "recorder") as node:
        links = sender.advertise(LINK_STATES)
        params = RecorderParameters(output=str(folder))
        make_pacer = lambda *_: LockstepWithoutOthers(node, links)  # noqa: E731
        with pytest.raises(Stopped):
            SERVICE.entry()(Context(node, params, 25.0, lockstep=True, make_pacer=make_pacer))
    bag = open_bag(folder)
    recorded = [(each.sequence, each.publish_time) for each in bag.entries() if each.channel.topic == links.name]
    assert recorded == [*((step, step * STEP_NS) for step in range(1, STEPS + 1)), (STEPS + 1, STEPS * STEP_NS + 1)]
    assert lost_messages(bag) == {}


def times(folder: Path) -> list[int]:
    """Return the publish times of the commands in a bag [ns, simulation time]."""
    return [each.publish_time for each in open_bag(folder).entries() if each.channel.topic == "/r/cmd_vel"]
