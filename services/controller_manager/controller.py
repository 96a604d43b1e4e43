"""What all controllers have in common: what the manager asks of one, and what one is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from messages.joints import JointTarget
from messages.topics import Topic
from services.controller_manager.config import ControllerConfig
from services.controller_manager.joint_pid import Announce
from services.controller_manager.robot_state import CommandLimiter, RobotState
from services.runtime.publisher import Publisher
from services.runtime.subscriber import Stream

MAX_GAP_S = 0.1
"""Time between two control ticks beyond which it has jumped: nothing is integrated or differentiated over it."""


@dataclass(frozen=True)
class Ports:
    """How a controller reaches the network: inputs, outputs, sets of parameters, the limits, and the log."""

    stream: Callable[[Topic[Any]], Stream[Any]]
    advertise: Callable[[Topic[Any]], Publisher[Any]]
    announce: Announce
    limiter: CommandLimiter
    warn: Callable[[str], None]
    command_timeout: Callable[[], float]
    """s; 0 for none."""


class Controller(Protocol):
    """One controller of a file. Times are simulation time, ns."""

    config: ControllerConfig

    def read(self, now: int, refusal: str) -> None:
        """Take the commands that have come; refuse all with the reason ``refusal``, if there is one."""

    def start(self, state: RobotState, now: int) -> None:
        """Begin to command: hold the joints where they are, or at rest."""

    def halt(self, reason: str, now: int) -> None:
        """Command no more; what was asked for is over, for this reason."""

    def update(self, state: RobotState, now: int, dt: float) -> list[JointTarget]:
        """The targets of its joints, ``dt`` [s] after those before."""

    def publish(self, now: int) -> None:
        """Publish its state, if that is due."""


class Due:
    """Tells when something of a rate [Hz] is due again; of the rate 0, never."""

    def __init__(self, rate: float) -> None:
        self._period = round(1e9 / rate) if rate > 0 else 0
        self._next = 0

    def __call__(self, now: int) -> bool:
        """Whether it is due at ``now`` [ns]."""
        if not self._period or (now < self._next and self._next - now <= self._period):
            return False
        self._next = now - now % self._period + self._period
        return True
