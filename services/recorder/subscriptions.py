"""Subscribes to the topics to be recorded as soon as a node publishes or subscribes to them."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from messages.base import Message
from messages.interfaces.records import find_record
from messages.names import BadName
from messages.records import unknown_record
from messages.topics import CLOCK, INTERFACES, TOPICS, Quality, Topic, limit_of
from services.recorder import RecorderParameters
from services.runtime.errors import BadInput
from services.runtime.graph import Entity, Kind, token_pattern
from services.runtime.interfaces import learn_interfaces
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber, foreign_queue_size, queue_size
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE


class TopicFilter:
    """The topics that the parameters select; ``resolve`` makes names absolute. Raises BadInput for an invalid name."""

    def __init__(self, params: RecorderParameters, resolve: Callable[[str], str]) -> None:
        try:
            self.named = frozenset(resolve(name) for name in params.topics)
        except BadName as error:
            raise BadInput(f"recorder, topics: {error}") from None
        self._regex, self._exclude = _compile("regex", params.regex), _compile("exclude", params.exclude)
        self._all = not params.topics and self._regex is None

    def __contains__(self, topic: str) -> bool:
        if self._exclude is not None and self._exclude.search(topic):
            return False
        return self._all or topic in self.named or bool(self._regex is not None and self._regex.search(topic))


def _compile(name: str, text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise BadInput(f"recorder, {name}: {text!r} is not a regular expression: {error}") from None


_KINDS: tuple[Kind, ...] = ("pub", "sub")


class Subscriptions:
    """Subscribers of the selected topics, ``by_topic``; the types of those in ``raw`` were unknown when subscribed.

    ``clock`` is always subscribed to, recorded or not.
    """

    def __init__(self, node: Node, topic_filter: TopicFilter) -> None:
        self._node, self._filter = node, topic_filter
        self._watches = [node.transport.watch(token_pattern(kind)) for kind in _KINDS]
        self.clock: Subscriber[Any] = node.subscribe(CLOCK)
        self.by_topic: dict[str, Subscriber[Any]] = {}
        self.raw: set[str] = set()
        self._type_mismatches: set[tuple[str, str, str]] = set()
        self.has_clock = False
        self._interfaces: Subscriber[Any] | None = None

    def learn_interfaces(self) -> None:
        """Learn the types that scripts have announced since the last update of the node's subscribers."""
        if self._interfaces is not None:
            learn_interfaces((message for message, _ in self._interfaces.messages), self._node.log.warn)

    def subscribe_existing(self) -> None:
        """Subscribe to the topics that exist now; ``update`` would find them a moment later."""
        for kind in _KINDS:
            for key in self._node.transport.tokens(token_pattern(kind)):
                self._subscribe(Entity.parse(key))

    def update(self) -> None:
        """Subscribe to new topics, and set ``has_clock`` if a node publishes ``/clock``."""
        for watch in self._watches:
            while (event := watch.poll()) is not None:
                if event.alive:
                    self._subscribe(Entity.parse(event.key))

    @property
    def missing(self) -> list[str]:
        """Topics named in the parameters that have no publisher or subscriber."""
        return sorted(self._filter.named - self.by_topic.keys())

    def _subscribe(self, entity: Entity | None) -> None:
        if entity is None or entity.session == self._node.transport.session:
            return
        topic = entity.name
        if topic == INTERFACES.name and entity.kind == "pub" and self._interfaces is None:
            self._interfaces = self._node.subscribe(INTERFACES)
        self.has_clock = self.has_clock or (entity.kind == "pub" and topic == CLOCK.name)
        if topic not in self._filter or entity.record == "-":
            return
        if (known := self.by_topic.get(topic)) is not None:
            odd = entity.node, topic, entity.record
            if entity.record != known.topic.record.ROS_TYPE and odd not in self._type_mismatches:
                self._type_mismatches.add(odd)
                self._node.log.warn(
                    f"{entity.node} uses {topic} as {entity.record}: it is recorded as {known.topic.record.ROS_TYPE}"
                )
            return
        record = find_record(entity.record)
        if record is None:
            self.raw.add(topic)
        described = _topic(topic, record or unknown_record(entity.record), entity.detail)
        decode = bytes if record is None else None
        self.by_topic[topic] = self._node.subscribe(described, topic, decode, capacity=_capacity(described))
        self._node.spin_once()  # a hundred subscriptions on a busy machine take longer than a heartbeat may


def _topic(name: str, record: type[Message], quality: str) -> Topic[Any]:
    largest = [each.largest for each in TOPICS if each.record is record]
    kind = Quality[quality] if quality in Quality.__members__ else Quality.SENSOR
    return Topic(name, record, 0, kind, "", max(largest, default=LARGEST_MESSAGE))


def _capacity(topic: Topic[Any]) -> int:
    """Return the ring size for a topic, by the limit that its other subscribers have: the recorder's own is higher."""
    ros_type = topic.record.ROS_TYPE
    limit = limit_of(topic.name, ros_type)
    return foreign_queue_size(ros_type) if limit is None else queue_size(limit, topic.quality is Quality.EVENT)
