"""What all controllers have in common: joint readings, command limits, access to the node, and the interface."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from messages.joints import JointTarget
from messages.sensor import JointState
from messages.topics import Topic
from models.urdf import JointLimits
from services.controller_manager.config import ControllerConfig
from services.controller_manager.joint_pid import Announce
from services.runtime.publisher import Publisher
from services.runtime.subscriber import Stream

MAX_GAP_S = 0.1
"""Time [s] between two control ticks beyond which there is a gap: nothing is integrated or differentiated over it."""


class JointReading(NamedTuple):
    """Position [rad or m] and velocity [rad/s or m/s] of a joint."""

    position: float
    velocity: float


RobotState = Mapping[str, JointReading]
"""All joints of a robot, by name."""


def robot_state(message: JointState) -> RobotState:
    """Return the joints of a message; none if it lacks positions or velocities."""
    rows = zip(message.name, message.position, message.velocity, strict=False)
    return {name: JointReading(*row) for name, *row in rows}


def shortest_angle(start: float, end: float) -> float:
    """Return the shortest rotation [rad] from one angle to another, in [-pi, pi]."""
    return math.remainder(end - start, math.tau)


class CommandLimiter:
    """Clamps commands to the limits of the URDF; ``warn`` is called with the reason.

    A velocity limit of 0 or none means unlimited, as in most URDFs; ``effort`` is clamped without a warning, since the
    output of a PID often exceeds its limit.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self.limits: Mapping[str, JointLimits] = {}
        self._warn = warn

    def is_continuous(self, joint: str) -> bool:
        """Whether a joint is continuous."""
        return joint in self.limits and self.limits[joint].kind == "continuous"

    def error(self, joint: str, desired: float, position: float) -> float:
        """Return ``desired`` minus ``position`` [rad or m], the shorter way round for continuous joints."""
        return shortest_angle(position, desired) if self.is_continuous(joint) else desired - position

    def position(self, controller: str, joint: str, value: float) -> float:
        """Clamp a position [rad or m] to the joint's range."""
        limits = self.limits.get(joint, _NONE)
        low = -math.inf if limits.lower is None else limits.lower
        high = math.inf if limits.upper is None else limits.upper
        return self._clamp(controller, joint, "position", value, low, high)

    def velocity(self, controller: str, joint: str, value: float) -> float:
        """Clamp a velocity [rad/s or m/s] to the joint's limit."""
        limit = self.limits.get(joint, _NONE).velocity or math.inf
        return self._clamp(controller, joint, "velocity", value, -limit, limit)

    def effort(self, joint: str, value: float) -> float:
        """Clamp an effort [N m or N] to the joint's limit."""
        limit = self.limits.get(joint, _NONE).effort
        return value if limit is None else max(-limit, min(limit, value))

    def _clamp(self, controller: str, joint: str, what: str, value: float, low: float, high: float) -> float:
        if low <= value <= high:
            return value
        bound = low if value < low else high
        self._warn(f"{controller}: the {what} {value:g} of {joint} is clamped to {bound:g}, its limit in the URDF")
        return bound


_NONE = JointLimits(kind="continuous")


@dataclass(frozen=True)
class Ports:
    """A controller's access to its node: subscriptions, publishers, parameter sets, command limits and the log."""

    stream: Callable[[Topic[Any]], Stream[Any]]
    advertise: Callable[[Topic[Any]], Publisher[Any]]
    announce: Announce
    limiter: CommandLimiter
    warn: Callable[[str], None]
    command_timeout: Callable[[], float]
    """Command time-out [s]; 0 for none."""


class Controller(Protocol):
    """One controller of a file. Times are simulation time, ns."""

    config: ControllerConfig

    def read(self, now: int, refusal: str) -> None:
        """Process the received commands; refuse all with the reason ``refusal`` if it is not empty."""

    def start(self, state: RobotState, now: int) -> None:
        """Start commanding: hold the joints at their positions, or at rest."""

    def halt(self, reason: str, now: int) -> None:
        """Stop commanding; the current command or goal ends with this reason."""

    def update(self, state: RobotState, now: int, dt: float) -> list[JointTarget]:
        """Return the targets of its joints, ``dt`` [s] after the last ones."""

    def publish(self, now: int) -> None:
        """Publish its state if that is due."""


class Due:
    """Reports when something with a rate [Hz] is due again; with rate 0, never."""

    def __init__(self, rate: float) -> None:
        self._period = round(1e9 / rate) if rate > 0 else 0
        self._next = 0

    def __call__(self, now: int) -> bool:
        """Whether it is due at ``now`` [ns]."""
        if not self._period or (now < self._next and self._next - now <= self._period):
            return False
        self._next = now - now % self._period + self._period
        return True
