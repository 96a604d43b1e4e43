"""The panel's subscriptions: one for each topic that a page shows, closed when none shows it any more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from messages.base import raw_decoder
from messages.records import RECORDS, unknown_record
from messages.topics import TOPICS, Quality, Topic
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import SampleInfo

MAX_UNTYPED_SIZE = 1 << 20
"""Maximum bytes of a message of unknown type."""
_read_map: Callable[[bytes], Any] = raw_decoder(dict)
"""Reads a message of unknown type."""

Received = list[tuple[Any, SampleInfo | None]]

_MAX_SIZES: dict[str, int] = {}
for _topic in TOPICS:
    _MAX_SIZES[_topic.record.ROS_TYPE] = max(_topic.largest, _MAX_SIZES.get(_topic.record.ROS_TYPE, 0))


class SharedSubscriptions:
    """Opens and closes subscriptions by how many want them. Used by the loop alone."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._open: dict[tuple[str, str], tuple[Subscriber[Any], int]] = {}
        self._owned_by_node: set[tuple[str, str]] = set()

    def acquire(self, name: str, record: str, quality: str = "SENSOR") -> Subscriber[Any]:
        """The subscription to an absolute topic with a ROS type; each call needs its own ``release``."""
        feed, users = self._open.get((name, record), (None, 0))
        if feed is None:
            feed = self._subscribe(name, record, Quality.__members__.get(quality, Quality.SENSOR))
        self._open[name, record] = feed, users + 1
        return feed

    def release(self, name: str, record: str) -> None:
        """End one use of a subscription; the last one closes it."""
        feed, users = self._open[name, record]
        if users > 1:
            self._open[name, record] = feed, users - 1
            return
        del self._open[name, record]
        if (name, record) in self._owned_by_node:
            self._owned_by_node.discard((name, record))
        else:
            self._node.unregister(feed)

    def update(self) -> None:
        """Read the new messages of all of them."""
        self._node.update_subscribers()

    def _subscribe(self, name: str, ros_type: str, quality: Quality) -> Subscriber[Any]:
        record, decode = RECORDS.get(ros_type), None
        if record is None:
            record, decode = unknown_record(ros_type), _read_map
        if any(each.name == name and each.topic.record is record for each in self._node.subscribers):
            self._owned_by_node.add((name, ros_type))  # the node itself reads it, and goes on
        largest = _MAX_SIZES.get(ros_type, MAX_UNTYPED_SIZE)
        return self._node.subscribe(Topic(name, record, 0, quality, "", largest), name, decode)


class SubscriptionGroup:
    """The feeds that one part of the panel wants, as a set that may change; those it leaves out are closed."""

    def __init__(self, feeds: SharedSubscriptions) -> None:
        self._shared = feeds
        self._held: dict[tuple[str, str], Subscriber[Any]] = {}

    def set_topics(self, wanted: dict[tuple[str, str], str]) -> None:
        """From now on these topics, by name and type, each with its quality."""
        for place in [each for each in self._held if each not in wanted]:
            del self._held[place]
            self._shared.release(*place)
        for (name, record), quality in wanted.items():
            if (name, record) not in self._held:
                self._held[name, record] = self._shared.acquire(name, record, quality)

    def messages(self, name: str, record: str) -> Received:
        """What came on a topic; nothing when it is not held."""
        feed = self._held.get((name, record))
        return feed.messages if feed is not None else []

    def __contains__(self, place: tuple[str, str]) -> bool:
        return place in self._held

    def topics(self) -> list[tuple[str, str]]:
        """The topics held, by name and type."""
        return list(self._held)
