"""The topics that are read at present: one subscription each, for as long as somebody wants it."""

from __future__ import annotations

from typing import Any, Protocol

from messages.base import FAULTS, Message, bare_decoder
from messages.names import key as key_of
from messages.records import RECORDS
from messages.topics import TOPICS, Quality, Topic
from services.runtime.inputs import Input, ring
from services.runtime.network.wire import Origin, detach
from services.runtime.node import Node

LARGEST_FOREIGN = 1 << 20
"""Bytes of a message of unknown type that are read."""

Batch = list[tuple[Any, Origin | None]]

_LARGEST: dict[str, int] = {}
for _topic in TOPICS:
    _LARGEST[_topic.record.ROS_TYPE] = max(_topic.largest, _LARGEST.get(_topic.record.ROS_TYPE, 0))


class Feed(Protocol):
    """One subscription; ``batch`` is what came with the last turn."""

    @property
    def batch(self) -> Batch: ...


class ForeignFeed:
    """A topic whose type is not known here, read as MessagePack tells it."""

    def __init__(self, node: Node, name: str, latched: bool) -> None:
        self.batch: Batch = []
        self.refused = 0
        self._inlet = node.transport.subscribe(key_of(name), ring(LARGEST_FOREIGN), latched)
        self._read = bare_decoder(dict)

    def admit(self) -> None:
        """Take what has come."""
        self.batch = []
        while (sample := self._inlet.take()) is not None:
            payload, attachment, _ = sample
            try:
                if len(payload) > LARGEST_FOREIGN:
                    raise ValueError("too large")
                self.batch.append((self._read(payload), detach(attachment)))
            except FAULTS:
                self.refused += 1

    def close(self) -> None:
        """End the subscription."""
        self._inlet.close()


class Feeds:
    """Opens and closes subscriptions by how many want them. Used by the loop alone."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._open: dict[tuple[str, str], tuple[Input[Any] | ForeignFeed, int]] = {}
        self._borrowed: set[tuple[str, str]] = set()

    def open(self, name: str, record: str, quality: str = "SENSOR") -> Feed:
        """The feed of an absolute topic with a ROS type; each call wants its own ``close``."""
        feed, users = self._open.get((name, record), (None, 0))
        if feed is None:
            kind = Quality.__members__.get(quality, Quality.SENSOR)
            known = RECORDS.get(record)
            feed = self._known(name, known, kind) if known else ForeignFeed(self._node, name, kind is Quality.LATCHED)
        self._open[name, record] = feed, users + 1
        return feed

    def close(self, name: str, record: str) -> None:
        """One who wanted it does no more."""
        feed, users = self._open[name, record]
        if users > 1:
            self._open[name, record] = feed, users - 1
            return
        del self._open[name, record]
        if (name, record) in self._borrowed:
            self._borrowed.discard((name, record))
        elif isinstance(feed, ForeignFeed):
            feed.close()
        else:
            self._node.forget(feed)

    def admit(self) -> None:
        """Take what has come on all of them."""
        self._node.admit()
        for feed, _ in self._open.values():
            if isinstance(feed, ForeignFeed):
                feed.admit()

    def _known(self, name: str, record: type[Message], quality: Quality) -> Input[Any]:
        if any(each.name == name and each.topic.record is record for each in self._node.inputs):
            self._borrowed.add((name, record.ROS_TYPE))  # the node itself reads it, and goes on
        largest = _LARGEST.get(record.ROS_TYPE, LARGEST_FOREIGN)
        return self._node.read(Topic(name, record, 0, quality, "", largest), name)


class Hold:
    """The feeds that one part of the panel wants, as a set that may change; those it leaves out are closed."""

    def __init__(self, feeds: Feeds) -> None:
        self._feeds = feeds
        self._held: dict[tuple[str, str], Feed] = {}

    def want(self, wanted: dict[tuple[str, str], str]) -> None:
        """From now on these topics, by name and type, each with its quality."""
        for place in [each for each in self._held if each not in wanted]:
            del self._held[place]
            self._feeds.close(*place)
        for (name, record), quality in wanted.items():
            if (name, record) not in self._held:
                self._held[name, record] = self._feeds.open(name, record, quality)

    def batch(self, name: str, record: str) -> Batch:
        """What came on a topic; nothing when it is not held."""
        feed = self._held.get((name, record))
        return feed.batch if feed is not None else []

    def __contains__(self, place: tuple[str, str]) -> bool:
        return place in self._held

    def places(self) -> list[tuple[str, str]]:
        """The topics held, by name and type."""
        return list(self._held)
