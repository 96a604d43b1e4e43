"""The panel's subscriptions: one for each topic shown on a page, closed when no page shows it any longer."""

from __future__ import annotations

from typing import Any

from messages.base import WrongPayload
from messages.interfaces.records import find_record
from messages.plain import plain
from messages.records import unknown_record
from messages.topics import Quality, Topic, largest_of
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import SampleInfo

Received = list[tuple[Any, SampleInfo | None]]


class SharedSubscriptions:
    """Reference-counted subscriptions, closed by the last user. Used in the loop's thread only."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._open: dict[tuple[str, str], tuple[Subscriber[Any], int]] = {}
        self._owned_by_node: set[tuple[str, str]] = set()

    def acquire(self, name: str, record: str, quality: str = "SENSOR") -> Subscriber[Any]:
        """Return the subscription to an absolute topic with a ROS type; each call needs its own ``release``."""
        subscriber, users = self._open.get((name, record), (None, 0))
        if subscriber is None:
            subscriber = self._subscribe(name, record, Quality.__members__.get(quality, Quality.SENSOR))
        self._open[name, record] = subscriber, users + 1
        return subscriber

    def release(self, name: str, record: str) -> None:
        """End one use of a subscription; the last one closes it."""
        subscriber, users = self._open[name, record]
        if users > 1:
            self._open[name, record] = subscriber, users - 1
            return
        del self._open[name, record]
        if (name, record) in self._owned_by_node:
            self._owned_by_node.discard((name, record))
        else:
            self._node.unregister(subscriber)

    def update(self) -> None:
        """Read the new messages of all subscriptions."""
        self._node.update_subscribers()

    def _subscribe(self, name: str, ros_type: str, quality: Quality) -> Subscriber[Any]:
        record, decode = find_record(ros_type), None
        if record is None:
            record, decode = unknown_record(ros_type), _read_map
        if any(each.name == name and each.topic.record is record for each in self._node.subscribers):
            self._owned_by_node.add((name, ros_type))  # the node itself keeps using it
        topic = Topic(name, record, 0, quality, "", largest_of(name, ros_type))
        return self._node.subscribe(topic, name, decode)


def _read_map(payload: bytes) -> dict[str, Any]:
    """Decode a message of unknown type; raises WrongPayload."""
    value = plain(payload)
    if not isinstance(value, dict):
        raise WrongPayload(f"expected a map of fields, got {type(value).__name__}")
    return value


class SubscriptionGroup:
    """The topics subscribed to by one part of the panel, as a set that may change."""

    def __init__(self, shared: SharedSubscriptions) -> None:
        self._shared = shared
        self._held: dict[tuple[str, str], Subscriber[Any]] = {}

    def set_topics(self, wanted: dict[tuple[str, str], str]) -> None:
        """Set the topics, by name and type, each with its quality; all others are released."""
        for place in [each for each in self._held if each not in wanted]:
            del self._held[place]
            self._shared.release(*place)
        for (name, record), quality in wanted.items():
            if (name, record) not in self._held:
                self._held[name, record] = self._shared.acquire(name, record, quality)

    def messages(self, name: str, record: str) -> Received:
        """Return the new messages of a topic; an empty list if the group does not include it."""
        subscriber = self._held.get((name, record))
        return subscriber.messages if subscriber is not None else []

    def topics(self) -> list[tuple[str, str]]:
        """Return the topics of the group, by name and type."""
        return list(self._held)
