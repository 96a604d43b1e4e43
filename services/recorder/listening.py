"""Subscriptions that follow the graph: a topic is heard as soon as somebody publishes or reads it."""

from __future__ import annotations

from typing import Any

from messages.base import Message
from messages.records import RECORDS
from messages.topics import CLOCK, TOPICS, Quality, Topic
from services.bag.typed import unknown_record
from services.recorder.selection import Selection
from services.runtime.graph import Entity, Kind, pattern
from services.runtime.inputs import Input
from services.runtime.network.zenoh_config import LARGEST_MESSAGE
from services.runtime.node import Node

_KINDS: tuple[Kind, ...] = ("pub", "sub")


class Listening:
    """``heard`` are the inputs by topic. What is of a type that is unknown here is heard ``raw``.

    The ``clock`` is heard in any case, be it to be recorded or not.
    """

    def __init__(self, node: Node, selection: Selection) -> None:
        self._node, self._selection = node, selection
        self._watches = [node.transport.watch(pattern(kind)) for kind in _KINDS]
        self.clock: Input[Any] = node.read(CLOCK)
        self.heard: dict[str, Input[Any]] = {}
        self.raw: set[str] = set()
        self._odd: set[tuple[str, str, str]] = set()
        self.timed = False

    def look(self) -> None:
        """Subscribe to all that is there by now; what the watches tell may come a moment later."""
        for kind in _KINDS:
            for key in self._node.transport.tokens(pattern(kind)):
                self._meet(Entity.parse(key))

    def update(self) -> None:
        """Subscribe to what is new. ``timed`` tells whether somebody publishes simulation time."""
        for watch in self._watches:
            while (event := watch.take()) is not None:
                if event.alive:
                    self._meet(Entity.parse(event.key))

    @property
    def missing(self) -> list[str]:
        """Topics that were named, and that nobody publishes or reads."""
        return sorted(self._selection.named - self.heard.keys())

    def _meet(self, entity: Entity | None) -> None:
        if entity is None or entity.session == self._node.transport.session:
            return
        topic = entity.name
        self.timed = self.timed or (entity.kind == "pub" and topic == CLOCK.name)
        if topic not in self._selection or entity.record == "-":
            return
        if (known := self.heard.get(topic)) is not None:
            odd = entity.node, topic, entity.record
            if entity.record != known.topic.record.ROS_TYPE and odd not in self._odd:
                self._odd.add(odd)
                self._node.log.warn(
                    f"{entity.node} uses {topic} as {entity.record}: it is recorded as {known.topic.record.ROS_TYPE}"
                )
            return
        record = RECORDS.get(entity.record)
        if record is None:
            self.raw.add(topic)
            self._node.log.warn(f"{topic} is {entity.record}, which is unknown here: it is kept as MessagePack")
        described = _topic(topic, record or unknown_record(entity.record), entity.detail)
        self.heard[topic] = self._node.read(described, topic, raw=record is None)
        self._node.turn()  # a hundred subscriptions on a busy machine take longer than a heartbeat may


def _topic(name: str, record: type[Message], quality: str) -> Topic[Any]:
    largest = [each.largest for each in TOPICS if each.record is record]
    kind = Quality[quality] if quality in Quality.__members__ else Quality.SENSOR
    return Topic(name, record, 0, kind, "", max(largest, default=LARGEST_MESSAGE))
