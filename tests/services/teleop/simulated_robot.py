"""A robot to teleoperate, in real processes: a router, a simulation in real time, and a recorder of the robot."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import dropwhile
from pathlib import Path

from messages.elea import BaseStatus
from tests.harness.processes import Network, Process
from tests.harness.robot_recorder import STANDSTILL_SPEED, WHEELS, CommandSample, RobotRecorder, TruthSample
from tests.harness.waiting import wait_until
from tests.services.teleop.pseudo_terminal import KeyEvents, PseudoTerminal

ROBOT = "rover"
"""A burger: at 0.22 m/s it stops within 0.22 s."""
MAX_SPEED = WHEELS.max_linear
WITHIN_S = 60.0


class SimulatedRobot:
    """The robot and its network."""

    def __init__(self, network: Network, sim: Process, track: RobotRecorder) -> None:
        self.network, self.sim, self.recorder = network, sim, track
        wait_until(lambda: self.poll() or self.recorder.samples, WITHIN_S, "ground truth")

    def poll(self) -> None:
        """Read new messages."""
        assert self.sim.status is None, self.sim.text
        self.recorder.poll()

    def wait(self, seconds: float) -> None:
        """Record until ``seconds`` of simulation time have passed."""
        self.poll()
        end = self.recorder.samples[-1].time + seconds * 1e9
        wait_until(lambda: self.poll() or self.recorder.samples[-1].time >= end, WITHIN_S, f"{seconds} s of simulation")

    def wait_standing(self) -> None:
        """Wait until the robot stands still."""
        wait_until(lambda: self.poll() or abs(self.recorder.speed) < STANDSTILL_SPEED, WITHIN_S, "a robot that stands")

    def status(self) -> BaseStatus:
        """Wait for a status that the base sends from now on and return it; all samples sent before it are there."""
        now = time.time_ns()
        sent = self.recorder.statuses
        wait_until(lambda: self.poll() or (sent and sent[-1][0] > now), WITHIN_S, "the state of the base")
        return self.recorder.base

    def lag(self, first: TruthSample, last: TruthSample) -> float:
        """Return by how much [s] simulation time fell behind between two samples."""
        return (last.sent - first.sent - (last.time - first.time)) / 1e9

    def commands_between(self, since: float, to: float) -> list[CommandSample]:
        """Return the commands sent between two times [s, ``time.monotonic``]."""
        self.poll()
        begin, end = wall_ns(since), wall_ns(to)
        return [each for each in self.recorder.command_samples if begin <= each.sent <= end]

    def samples_between(self, since: float, to: float) -> list[TruthSample]:
        """Return the ground truth between two times [s, ``time.monotonic``]."""
        self.poll()
        begin, end = wall_ns(since), wall_ns(to)
        return [each for each in self.recorder.samples if begin <= each.sent <= end]

    def first_zero_after(self, instant: float) -> CommandSample:
        """Wait for the first zero command sent after a time [s, ``time.monotonic``] and return it."""
        begin = wall_ns(instant)

        def found() -> list[CommandSample]:
            self.poll()
            return [each for each in self.recorder.command_samples if each.sent > begin and not each.moves]

        return wait_until(found, WITHIN_S, "a zero")[0]


def wall_ns(instant: float) -> int:
    """Convert a time of ``time.monotonic`` [s] to the machine's clock [ns]."""
    # One measured while this process is preempted between both clocks is too small.
    return round((instant + max(time.time() - time.monotonic() for _ in range(3))) * 1e9)


@contextmanager
def simulated_robot(logs: Path) -> Iterator[SimulatedRobot]:
    """Run a robot at rest, in real time."""
    with Network(logs) as network:
        sim = network.start("sim", "--param", f'robots=[{{"name": "{ROBOT}", "model": "burger"}}]')
        with network.node() as node:
            yield SimulatedRobot(network, sim, RobotRecorder(node, ROBOT))


@contextmanager
def teleop_terminal(drive: SimulatedRobot, *options: str) -> Iterator[PseudoTerminal]:
    """Run ``elea teleop`` in a terminal; yield it once it is ready, the robot stands and no command is under way."""
    arguments = ["-m", "deploy", "teleop", f"/{ROBOT}", "--connect", drive.network.endpoint, *options]
    with PseudoTerminal(arguments) as terminal:
        terminal.wait_ready()
        wait_until(lambda: "driving" in terminal.text, WITHIN_S, "the display")
        drive.wait_standing()
        yield terminal


def assert_moved_smoothly(drive: SimulatedRobot, strokes: KeyEvents) -> None:
    """Assert that the robot kept its speed, once reached, until the last event, without a zero command on the way.

    A zero of the previous hold may still be sent just after the first event is typed.
    """
    first, last = strokes.times[0], strokes.times[-1]
    begin = wall_ns(first)
    commands = dropwhile(lambda each: not each.moves, drive.commands_between(first, last))
    zeros = [(each.sent - begin) / 1e9 for each in commands if not each.moves]
    assert not zeros, f"released {zeros} s after the first event; repeats from {strokes.times[1] - first} s on"
    cruise = [*dropwhile(lambda each: each.speed <= 0.95 * MAX_SPEED, drive.samples_between(first, last))]
    assert cruise, "never at full speed"
    slow = [((each.sent - begin) / 1e9, each.speed) for each in cruise if each.speed <= 0.95 * MAX_SPEED]
    assert not slow, f"slow without being released (time after the first event, speed): {slow}"
