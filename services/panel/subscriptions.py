"""The topics that are read at present: one subscription each, for as long as somebody wants it."""

from __future__ import annotations

from typing import Any, Protocol

from messages.base import DECODE_ERRORS, Message, raw_decoder
from messages.records import RECORDS
from messages.topics import TOPICS, Quality, Topic
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber, queue_size
from services.runtime.transport.wire import SampleInfo
from services.runtime.untyped_subscriber import UntypedSubscriber

MAX_UNTYPED_SIZE = 1 << 20
"""Bytes of a message of unknown type that are read."""

Received = list[tuple[Any, SampleInfo | None]]

_MAX_SIZES: dict[str, int] = {}
for _topic in TOPICS:
    _MAX_SIZES[_topic.record.ROS_TYPE] = max(_topic.largest, _MAX_SIZES.get(_topic.record.ROS_TYPE, 0))


class SharedSubscription(Protocol):
    """One subscription; ``messages`` is what came with the last turn."""

    @property
    def messages(self) -> Received: ...


class UntypedSubscription:
    """A topic whose type is not known here, read as MessagePack."""

    def __init__(self, node: Node, name: str, latched: bool) -> None:
        self.messages: Received = []
        self.rejected = 0
        self._subscriber = UntypedSubscriber(node.transport, name, latched, queue_size(MAX_UNTYPED_SIZE))
        self._read = raw_decoder(dict)

    def update(self) -> None:
        """Read what has come."""
        self.messages = []
        for sample in self._subscriber.drain():
            try:
                if len(sample.payload) > MAX_UNTYPED_SIZE:
                    raise ValueError("too large")
                self.messages.append((self._read(sample.payload), sample.origin))
            except DECODE_ERRORS:
                self.rejected += 1

    def close(self) -> None:
        """End the subscription."""
        self._subscriber.close()


class SharedSubscriptions:
    """Opens and closes subscriptions by how many want them. Used by the loop alone."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._open: dict[tuple[str, str], tuple[Subscriber[Any] | UntypedSubscription, int]] = {}
        self._owned_by_node: set[tuple[str, str]] = set()

    def acquire(self, name: str, record: str, quality: str = "SENSOR") -> SharedSubscription:
        """The feed of an absolute topic with a ROS type; each call wants its own ``close``."""
        feed, users = self._open.get((name, record), (None, 0))
        if feed is None:
            kind = Quality.__members__.get(quality, Quality.SENSOR)
            known = RECORDS.get(record)
            feed = (
                self._subscribe(name, known, kind)
                if known
                else UntypedSubscription(self._node, name, kind is Quality.LATCHED)
            )
        self._open[name, record] = feed, users + 1
        return feed

    def release(self, name: str, record: str) -> None:
        """One who wanted it does no more."""
        feed, users = self._open[name, record]
        if users > 1:
            self._open[name, record] = feed, users - 1
            return
        del self._open[name, record]
        if (name, record) in self._owned_by_node:
            self._owned_by_node.discard((name, record))
        elif isinstance(feed, UntypedSubscription):
            feed.close()
        else:
            self._node.unregister(feed)

    def update(self) -> None:
        """Take what has come on all of them."""
        self._node.update_subscribers()
        for feed, _ in self._open.values():
            if isinstance(feed, UntypedSubscription):
                feed.update()

    def _subscribe(self, name: str, record: type[Message], quality: Quality) -> Subscriber[Any]:
        if any(each.name == name and each.topic.record is record for each in self._node.subscribers):
            self._owned_by_node.add((name, record.ROS_TYPE))  # the node itself reads it, and goes on
        largest = _MAX_SIZES.get(record.ROS_TYPE, MAX_UNTYPED_SIZE)
        return self._node.subscribe(Topic(name, record, 0, quality, "", largest), name)


class SubscriptionGroup:
    """The feeds that one part of the panel wants, as a set that may change; those it leaves out are closed."""

    def __init__(self, feeds: SharedSubscriptions) -> None:
        self._shared = feeds
        self._held: dict[tuple[str, str], SharedSubscription] = {}

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
