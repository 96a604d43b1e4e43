"""What was seen of one robot, on two clocks: simulation time, and the machine's clock at which each sample was sent.

Senders and observer are on one machine, so sending times tell cause from effect whatever the network's delay: a motion
that was reported before a command was sent is none of its doing.
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from messages.elea import BaseStatus
from messages.nav import Odometry
from messages.topics import BASE_STATUS, CMD_VEL, GROUND_TRUTH
from models.figures import Wheels, read_model
from services.runtime.node import Node
from services.sim import BaseParameters
from services.sim.timing import SLACK_S

_BURGER = read_model("burger").wheels
assert _BURGER is not None
WHEELS: Wheels = _BURGER
FULL_SPEED = 0.95 * WHEELS.max_linear
STANDING = 0.002
"""m/s; below this a robot stands."""
PERIOD_S = 0.02
"""Simulation time between two samples of ground truth."""

TIMEOUT_S = BaseParameters().cmd_vel_timeout
BRAKING_S = WHEELS.max_linear / WHEELS.brake
LATEST_STOP_S = TIMEOUT_S + BRAKING_S + 2 * PERIOD_S + SLACK_S
"""Simulation time from the last command to a robot that stands: both ends lie between two samples, and the simulation
may just then make up for what it lagged behind the wall clock."""


class Sight(NamedTuple):
    """A sample of ground truth: simulation time [ns], when it was sent [ns], speed [m/s], position [m]."""

    time: int
    sent: int
    speed: float
    x: float
    y: float


class Track:
    """The samples of one robot, and what they say."""

    def __init__(self, node: Node, name: str) -> None:
        self.name = name
        self.truth = node.read(GROUND_TRUTH, f"/{name}/ground_truth")
        self._commands = node.read(CMD_VEL, f"/{name}/cmd_vel")
        self._status = node.read(BASE_STATUS, f"/{name}/base_status")
        self.sights: list[Sight] = []
        self.commands: list[int] = []
        self.statuses: list[tuple[int, BaseStatus]] = []

    def look(self) -> None:
        """Take what has come; commands to stand still do not count."""
        for input_ in (self.truth, self._commands, self._status):
            input_.admit()
        self.sights += [_sight(message, o.source_ns) for message, o in self.truth.batch if o]
        moving = [o.source_ns for m, o in self._commands.batch if o and (m.linear.x or m.angular.z)]
        self.commands += moving
        self.statuses += [(o.source_ns, message) for message, o in self._status.batch if o]

    @property
    def speed(self) -> float:
        """The newest speed [m/s]; 0 before the first sample."""
        return self.sights[-1].speed if self.sights else 0.0

    @property
    def base(self) -> BaseStatus:
        """The newest state of the base."""
        return self.statuses[-1][1] if self.statuses else BaseStatus()

    def stood(self, instant: int) -> Sight | None:
        """The first sight of the robot standing after an instant [ns of the machine's clock]."""
        return next((each for each in self.sights if each.sent > instant and each.speed < STANDING), None)

    def time(self, instant: int) -> int:
        """The last simulation time [ns] that was told before an instant."""
        return max(each.time for each in self.sights if each.sent <= instant)

    def seconds_to_stop(self, instant: int) -> float:
        """Simulation time [s] from an instant until the robot stood."""
        stood = self.stood(instant)
        assert stood is not None, f"{self.name} did not stop"
        return (stood.time - self.time(instant)) / 1e9

    def fresh_command(self, instant: int) -> int | None:
        """When the first command to move after an instant was sent."""
        return next((each for each in self.commands if each > instant), None)

    def unbidden(self, instant: int) -> list[Sight]:
        """Sights of a motion between the stop after an instant and the first fresh command after that stop."""
        stood = self.stood(instant)
        assert stood is not None, f"{self.name} did not stop"
        until = self.fresh_command(stood.sent) or self.sights[-1].sent + 1
        return [each for each in self.sights if stood.sent < each.sent < until and each.speed >= STANDING]


def _sight(truth: Odometry, sent: int) -> Sight:
    at, v, w = truth.pose.pose.position, truth.twist.twist.linear, truth.twist.twist.angular
    return Sight(truth.header.stamp.ns, sent, hypot(v.x, v.y) + abs(w.z) * WHEELS.separation / 2, at.x, at.y)
