"""The topics of a robot: their names, and publishers that publish under several names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from time import time_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.base import Message, encode
from messages.names import join
from messages.template import Template
from messages.topics import Topic
from models.model import RobotModel
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.step import STEP_NS
from services.sim.template_groups import TemplateGroup

CONTROL_STEPS = 4
"""Physics steps between two reads of the commands, and between two clock messages: 50 Hz. In real time both happen more
often where joint states are published faster, for the sake of their controllers (see ``Simulation.input_steps``); in
lockstep, inputs are also read whenever a member is due."""
ROUNDING = 1e-6
"""As a share of a period; a time this close to the end of a period counts as its end."""


def topic_names(topic: Topic[Any], model: RobotModel, namespace: str) -> list[str]:
    """Return the names of a robot's topic: ours, and the one from the tags of its URDF, if any.

    The second is relative to the robot's namespace even if the tag begins it with a slash or with that namespace: tags
    are written as if there were only one robot.
    """
    names = [join(namespace, topic.name)]
    if other := model.topics.get(topic.name):
        names.append(join(namespace, f"/{other}".removeprefix(namespace.rstrip("/") + "/").strip("/")))
    return list(dict.fromkeys(names))


class RobotPublisher:
    """A topic of a robot, published under its own name, and under its others after ``advertise_aliases``."""

    def __init__(self, node: Node, topic: Topic[Any], names: list[str]) -> None:
        self.record: type[Message] = topic.record
        self.ends: list[Publisher[Any]] = [node.advertise(topic, names[0])]
        self._node, self._topic, self._aliases = node, topic, names[1:]

    def advertise_aliases(self) -> None:
        """Publish under the other names, too, except those under which another topic is published already."""
        for name in self._aliases:
            if all(each.name != name for each in self._node.publishers):
                self.ends.append(self._node.advertise(self._topic, name))

    @property
    def has_subscribers(self) -> bool:
        """Whether any of its names has subscribers."""
        for each in self.ends:  # noqa: SIM110 - asked at each tick, and a generator takes four times as long
            if each.announced or each.has_subscribers:
                return True
        return False

    def publish(self, message: Message) -> None:
        """Publish under all names; raises TypeError if it is not the topic's record."""
        if type(message) is not self.record:
            raise TypeError(f"{self.ends[0].name} carries {self.record.__name__}, not {type(message).__name__}")
        self.publish_encoded(encode(message))

    def publish_encoded(self, payload: bytes, source_ns: int | None = None) -> None:
        """Publish an encoded record of the topic's type under all names, as ``Publisher`` does."""
        for each in self.ends:
            each.publish_encoded(payload, source_ns)


class RobotTopicGroup:
    """The same topic of several robots, whose messages are encoded and published together."""

    def __init__(self, publishers: Sequence[RobotPublisher], templates: Sequence[Template[Any]]) -> None:
        self._encoder = TemplateGroup(templates)
        self._ends = [(row, end) for row, each in enumerate(publishers) for end in each.ends]

    def publish(self, stamp: bytes, numbers: NDArray[np.float64]) -> None:
        """Fill each template with its row of ``numbers``, and publish the messages."""
        payloads, now = self._encoder.encode(stamp, numbers), time_ns()
        for row, end in self._ends:
            end.publish_encoded(payloads[row], now)


@cache
def steps_of(rate: float) -> int:
    """Return the physics steps between two messages of a topic of this rate [Hz]."""
    return round(1e9 / rate / STEP_NS)


def is_due(now: int, rate: float) -> bool:
    """Return whether a message of ``rate`` [Hz] is due at the control tick ``now`` [ns].

    The average rate is exact, as in ROS, up to that of control ticks, and counts from time 0: topics of the same rate
    have the same stamps, whenever their robots were spawned.
    """
    if rate <= 0:
        return False
    before = now - CONTROL_STEPS * STEP_NS
    return math.floor(now * rate / 1e9 + ROUNDING) > math.floor(before * rate / 1e9 + ROUNDING)
