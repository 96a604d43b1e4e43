"""A robot that slows down is excused only by a pause of its own controller, not by commands that were lost."""

from __future__ import annotations

from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node
from tests.harness.robot_recorder import FULL_SPEED, CommandSample, RobotRecorder, TruthSample

MS = 10**6


def recorder(*commands: tuple[int, bool]) -> RobotRecorder:
    """Return a recorder of a robot that is slow at 450 ms; commands have a time [ms], and whether none was missed."""
    with memory_node(MemoryBus(), "watcher") as node:
        made = RobotRecorder(node, "tb3_0")
    made.command_samples = [CommandSample(at * MS, True, consecutive) for at, consecutive in commands]
    speeds = {100: 1.0, 200: 1.0, 450: 0.9, 500: 1.0}
    made.samples = [TruthSample(at * MS, at * MS, 1.01 * part * FULL_SPEED, 0.0, 0.0) for at, part in speeds.items()]
    return made


def test_slowing_down_counts_while_commands_are_sent() -> None:
    slow = recorder((100, True), (140, True), (400, False), (440, True), (480, True))
    assert slow.pauses(0) == [], "those between 140 and 400 ms were lost"
    assert [each.sent for each in slow.slowed(0)] == [450 * MS]
    assert slow.slowed(450 * MS) == []


def test_slowing_down_after_the_last_command_counts() -> None:
    assert len(recorder((100, True), (140, True)).slowed(0)) == 1


def test_a_pause_of_the_controller_excuses_it() -> None:
    late = recorder((100, True), (140, True), (440, True), (480, True))
    assert late.pauses(0) == [(140 * MS, 440 * MS)]
    assert late.slowed(0) == []
    assert late.pauses(440 * MS) == []
