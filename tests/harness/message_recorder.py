"""A test's view of a topic: every message since it subscribed."""

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

WITHIN_S = 20.0
"""Wall time for what takes a moment, on a machine that is busy."""


class MessageRecorder(Generic[M]):
    """The messages of an input, oldest first."""

    def __init__(self, source: Subscriber[M]) -> None:
        self.source = source
        self._seen: list[M] = []

    def received(self) -> list[M]:
        """All so far."""
        self.source.update()
        self._seen += [message for message, _ in self.source.messages]
        return self._seen

    def wait_next(self, what: str = "") -> M:
        """One that arrives after this call."""
        count = len(self.received())
        wait_until(lambda: len(self.received()) > count, WITHIN_S, what or f"another message on {self.source.name}")
        return self._seen[-1]


class GroundTruthRecorder(MessageRecorder[Odometry]):
    """A robot's ground truth; times in s of simulation time."""

    def __init__(self, node: Node, robot: str) -> None:
        super().__init__(node.subscribe(GROUND_TRUTH, f"/{robot}/ground_truth"))

    def wait_until_time(self, seconds: float) -> Odometry:
        """The newest sample, once there is one at or after ``seconds``."""
        wait_until(
            lambda: self.received() and time_of(self.received()[-1]) >= seconds,
            WITHIN_S,
            f"simulation time {seconds:.2f} s",
        )
        return self.received()[-1]

    def wait_after(self, seconds: float) -> Odometry:
        """A sample that is so much younger than the newest one now."""
        return self.wait_until_time(time_of(self.wait_next()) + seconds)


def time_of(sample: Odometry) -> float:
    """Simulation time of a sample, s."""
    return sample.header.stamp.ns / 1e9


def distance(one: Odometry, other: Odometry) -> float:
    """Distance between two places, m."""
    a, b = one.pose.pose.position, other.pose.pose.position
    return hypot(a.x - b.x, a.y - b.y)


def speed(sample: Odometry) -> float:
    """Speed ahead, m/s."""
    return sample.twist.twist.linear.x
