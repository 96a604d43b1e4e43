"""Records every message of a topic since the subscription."""

from __future__ import annotations

from math import hypot
from typing import Generic, TypeVar

from messages.base import Message
from messages.nav import Odometry
from messages.topics import GROUND_TRUTH
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from tests.harness.waiting import wait_until

M = TypeVar("M", bound=Message)

WITHIN_S = 60.0
"""Wall time limit for what takes a moment on an idle machine."""


class MessageRecorder(Generic[M]):
    """All messages of a subscriber, oldest first."""

    def __init__(self, source: Subscriber[M]) -> None:
        self.source = source
        self._seen: list[M] = []

    def received(self) -> list[M]:
        """Return all messages so far."""
        self.source.update()
        self._seen += [message for message, _ in self.source.messages]
        return self._seen

    def wait_next(self, what: str = "") -> M:
        """Wait for a message that arrives after this call and return it."""
        count = len(self.received())
        wait_until(lambda: len(self.received()) > count, WITHIN_S, what or f"another message on {self.source.name}")
        return self._seen[-1]


class GroundTruthRecorder(MessageRecorder[Odometry]):
    """Records a robot's ground truth; times are simulation time [s]."""

    def __init__(self, node: Node, robot: str) -> None:
        super().__init__(node.subscribe(GROUND_TRUTH, f"/{robot}/ground_truth"))

    def wait_after(self, seconds: float) -> Odometry:
        """Wait for a sample at least ``seconds`` after the next one and return the newest."""
        end = time_of(self.wait_next()) + seconds
        wait_until(lambda: time_of(self.received()[-1]) >= end, WITHIN_S, f"simulation time {end:.2f} s")
        return self.received()[-1]

    def wait_until_still(self) -> Odometry:
        """Wait for a sample in which the robot neither drives nor turns and return it.

        In real time, the time of the stop depends on when the simulation read the last command.
        """

        def still() -> bool:
            sample = self.wait_next()
            return abs(speed(sample)) < 1e-3 and abs(sample.twist.twist.angular.z) < 1e-3

        wait_until(still, WITHIN_S, f"a robot that stands on {self.source.name}")
        return self.received()[-1]


def time_of(sample: Odometry) -> float:
    """Return the simulation time of a sample [s]."""
    return sample.header.stamp.ns / 1e9


def distance(one: Odometry, other: Odometry) -> float:
    """Return the distance in the x-y plane between two samples [m]."""
    a, b = one.pose.pose.position, other.pose.pose.position
    return hypot(a.x - b.x, a.y - b.y)


def speed(sample: Odometry) -> float:
    """Return the forward speed of a sample [m/s]."""
    return sample.twist.twist.linear.x
