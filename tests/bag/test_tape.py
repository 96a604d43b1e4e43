"""The order of what is recorded as it comes, and of what comes after the last tick: that of its sending."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from messages.geometry import Twist
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, CMD_VEL
from services.bag.folder import BagFolder
from services.bag.reading import open_bag
from services.recorder import RecorderParameters
from services.recorder.listening import Listening
from services.recorder.selection import Selection
from services.recorder.tape import Tape
from services.runtime.network.memory_transport import MemoryBus
from services.runtime.node import Node
from tests.runtime.bench import node
from tests.waiting import until


@contextmanager
def taping(folder: Path) -> Iterator[tuple[Node, Node, Tape]]:
    """A node that sends, one that listens, and the tape of what this one hears: the clock and a command."""
    bus = MemoryBus()
    with node(bus, "simulation") as sender, node(bus, "recorder") as taker, BagFolder(folder) as bag:
        sender.write(CLOCK)
        sender.write(CMD_VEL, "/r/cmd_vel")
        listening = Listening(taker, Selection(RecorderParameters(), taker.identity.resolve))
        listening.look()
        yield sender, taker, Tape(bag, listening, taker.log)


def test_a_command_that_overtakes_the_clock_has_the_time_before_which_it_was_sent(tmp_path: Path) -> None:
    with taping(tmp_path / "bag") as (sender, taker, tape):
        clock, command = sender.write(CLOCK), sender.write(CMD_VEL, "/r/cmd_vel")

        def take(end: bool = False) -> int:
            taker.admit()
            tape.take(end)
            return tape.now

        clock.publish(Clock(clock=Time.of(20_000_000)))
        until(lambda: take() == 20_000_000, what="the first clock")
        sender.outbox.hold()
        clock.publish(Clock(clock=Time.of(40_000_000)))
        command.publish(Twist.planar(0.1, 0.0))
        assert take() == 20_000_000, "the command is there, the clock before it is not"
        sender.outbox.release()
        until(lambda: take() == 40_000_000, what="the second clock")
        command.publish(Twist.planar(0.2, 0.0))
        take(end=True)
        tape.close()
    assert times(tmp_path / "bag") == [40_000_000, 40_000_000]


def test_what_comes_after_the_last_tick_has_the_time_at_which_it_was_sent(tmp_path: Path) -> None:
    """As late as the others went on without the recorder, and at no step: none of it counted in the run."""
    with taping(tmp_path / "bag") as (sender, taker, tape):
        clock, command = sender.write(CLOCK), sender.write(CMD_VEL, "/r/cmd_vel")
        for ms in (20, 40, 60, 80):
            clock.publish(Clock(clock=Time.of(ms * 1_000_000)))
            command.publish(Twist.planar(0.1, 0.0))
        taker.admit()
        tape.take_rest(40_000_000)
        tape.close()
    assert times(tmp_path / "bag") == [40_000_001, 40_000_001, 60_000_001, 80_000_001]


def times(folder: Path) -> list[int]:
    """When the commands in a bag were published, ns of simulation time."""
    return [each.publish_time for each in open_bag(folder).entries() if each.channel.topic == "/r/cmd_vel"]
