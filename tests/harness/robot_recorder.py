"""Records one robot's motion and commands in simulation time and in the machine's time at which each was sent.

Publishers and observer share one machine, so sending times order cause and effect whatever the network's delay: a
motion published before a command was sent cannot be caused by it.
"""

from __future__ import annotations

from itertools import pairwise
from math import hypot
from typing import NamedTuple

from messages.elea import BaseStatus
from messages.geometry import Twist
from messages.nav import Odometry
from messages.topics import BASE_STATUS, CMD_VEL, GROUND_TRUTH
from models.model import WheelConfig, read_model
from services.runtime.node import Node
from services.runtime.transport.wire import SampleInfo
from services.sim.parameters import BaseParameters
from services.sim.time_modes import MAX_LAG_S

BURGER = read_model("burger")
assert BURGER.wheels is not None
WHEELS: WheelConfig = BURGER.wheels
FULL_SPEED = 0.95 * WHEELS.max_linear
STANDSTILL_SPEED = 0.002
"""Below this speed [m/s] a robot counts as stopped."""
PERIOD_S = 1 / BURGER.odometry_rate
"""Simulation time between two samples of ground truth."""

TIMEOUT_S = BaseParameters().cmd_vel_timeout
BRAKING_S = WHEELS.max_linear / WHEELS.brake
LATEST_STOP_S = TIMEOUT_S + BRAKING_S + 2 * PERIOD_S + MAX_LAG_S
"""Longest simulation time [s] from the last command to standstill: each end is known only to one sample period, and the
simulation may be catching up with the wall clock by up to MAX_LAG_S.
"""
LATE_NS = round((TIMEOUT_S - MAX_LAG_S) / 2 * 1e9)
"""Pause between two commands [ns] after which the base may have timed out: on such a machine the simulation receives
late too, and it makes up for a lag of MAX_LAG_S at once."""
RECOVERY_NS = 5 * 10**9
"""Time [ns] for a robot to be back at full speed after such a pause, on a machine so busy that controllers are late."""


class TruthSample(NamedTuple):
    """A sample of ground truth: simulation time [ns], sending time [ns], fastest wheel's speed [m/s], position [m]."""

    time: int
    sent: int
    speed: float
    x: float
    y: float


class CommandSample(NamedTuple):
    """A received command: sending time [ns], whether it commands a motion, whether none before it was missed."""

    sent: int
    moves: bool
    consecutive: bool


class RobotRecorder:
    """Records and evaluates the samples of one robot."""

    def __init__(self, node: Node, name: str) -> None:
        self.name = name
        self.truth = node.subscribe(GROUND_TRUTH, f"/{name}/ground_truth")
        self._commands = node.subscribe(CMD_VEL, f"/{name}/cmd_vel")
        self._status = node.subscribe(BASE_STATUS, f"/{name}/base_status")
        self.samples: list[TruthSample] = []
        self.command_samples: list[CommandSample] = []
        self._numbers: dict[bytes, int] = {}
        self.statuses: list[tuple[int, BaseStatus]] = []

    def poll(self) -> None:
        """Read new messages."""
        for input_ in (self.truth, self._commands, self._status):
            input_.update()
        self.samples += [_truth_sample(message, o.source_ns) for message, o in self.truth.messages if o]
        self.command_samples += [self._command_sample(message, o) for message, o in self._commands.messages if o]
        self.statuses += [(o.source_ns, message) for message, o in self._status.messages if o]

    @property
    def speed(self) -> float:
        """The latest speed [m/s]; 0 before the first sample."""
        return self.samples[-1].speed if self.samples else 0.0

    @property
    def base(self) -> BaseStatus:
        """The latest base status."""
        return self.statuses[-1][1] if self.statuses else BaseStatus()

    def first_stop_after(self, instant: int) -> TruthSample | None:
        """Return the first sample of the robot standing still after an instant [ns, machine's clock]."""
        return next((each for each in self.samples if each.sent > instant and each.speed < STANDSTILL_SPEED), None)

    def sim_time_at(self, instant: int) -> int:
        """Return the last simulation time [ns] published up to an instant."""
        return max(each.time for each in self.samples if each.sent <= instant)

    def seconds_to_stop(self, instant: int) -> float:
        """Return the simulation time [s] from an instant until the robot stood still."""
        stood = self.first_stop_after(instant)
        assert stood is not None, f"{self.name} did not stop"
        return (stood.time - self.sim_time_at(instant)) / 1e9

    @property
    def command_instants(self) -> list[int]:
        """Sending times [ns] of the commands to move."""
        return [each.sent for each in self.command_samples if each.moves]

    def first_command_after(self, instant: int) -> int | None:
        """Return the sending time [ns] of the first command to move after an instant, None without one."""
        return next((each for each in self.command_instants if each > instant), None)

    def pauses(self, instant: int) -> list[tuple[int, int]]:
        """Return the pauses of more than LATE_NS that the controller itself has made after an instant, by the sending
        times [ns] of the commands before and after each: no number is missing between these.
        """
        sent = [(last.sent, next_.sent) for last, next_ in pairwise(self.command_samples) if next_.consecutive]
        return [(begin, end) for begin, end in sent if end > instant and end - begin > LATE_NS]

    def slowed(self, instant: int) -> list[TruthSample]:
        """Return the samples below full speed after an instant, except for those around a pause of the controller: a
        base stops when a starved controller is late, as it should.
        """
        pauses = self.pauses(instant)
        return [
            each
            for each in self.samples
            if each.sent > instant
            and each.speed <= FULL_SPEED
            and not any(begin < each.sent < end + RECOVERY_NS for begin, end in pauses)
        ]

    def uncommanded_motion(self, instant: int, able: int) -> list[TruthSample]:
        """Return the samples in motion between the stop after an instant and the first new command after that stop.

        A controller that rejoins may reach the robot before it reaches the observer. If a command was missed that way,
        ``able`` [ns] counts instead: before it no controller could send a command.
        """
        stood = self.first_stop_after(instant)
        assert stood is not None, f"{self.name} did not stop"
        first = next((each for each in self.command_samples if each.sent > stood.sent), None)
        fresh = self.first_command_after(stood.sent) if first is not None and first.consecutive else None
        return [
            each for each in self.samples if stood.sent < each.sent < (fresh or able) and each.speed >= STANDSTILL_SPEED
        ]

    def _command_sample(self, command: Twist, origin: SampleInfo) -> CommandSample:
        before = self._numbers.get(origin.publisher, 0)
        self._numbers[origin.publisher] = origin.sequence
        return CommandSample(
            origin.source_ns, bool(command.linear.x or command.angular.z), origin.sequence == before + 1
        )


def _truth_sample(truth: Odometry, sent: int) -> TruthSample:
    at, v, w = truth.pose.pose.position, truth.twist.twist.linear, truth.twist.twist.angular
    return TruthSample(truth.header.stamp.ns, sent, hypot(v.x, v.y) + abs(w.z) * WHEELS.separation / 2, at.x, at.y)
