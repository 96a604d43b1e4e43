"""The topics of a script: publications and subscriptions of any type, with encoded payloads."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from messages.records import unknown_record
from messages.topics import TOPICS, Quality, Topic
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.subscriber import QUEUE_SIZE, Subscriber, foreign_queue_size
from services.runtime.transport.api import Transport
from services.runtime.transport.wire import MEMBER_BYTES, SampleInfo, member_id
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE
from services.script.api import Origin
from services.script.budget import PUBLISH
from services.script.threads import Threads, Worker, report_exception

NEW_PUBLISHER_S = 0.3
"""Wall time [s] within which a publisher's token should follow its first sample."""
MOST_UNKNOWN = 64
"""Maximum number of publishers without a token that a topic waits for and keeps the last sample of; more are forged."""
ANY_TYPE = "-"
"""The type in the token of a subscription to every type."""


def known_topic(name: str) -> Topic[Any] | None:
    """Return this project's topic with an absolute name, in any namespace."""
    for topic in TOPICS:
        if name == topic.name or (topic.name[0] not in "/~" and name.endswith(f"/{topic.name}")):
            return topic
    return None


def topic_of(name: str, ros_type: str, latched: bool = False) -> Topic[Any]:
    """Return the topic that a script publishes or subscribes to, with this project's quality if it is one of ours."""
    quality, known = Quality.LATCHED if latched else Quality.EVENT, known_topic(name)
    if known is not None and ros_type == known.record.ROS_TYPE and not (latched and known.quality is Quality.SENSOR):
        quality = known.quality
    return Topic(name, unknown_record(ANY_TYPE if ros_type in ("", "*") else ros_type), 0, quality, "", LARGEST_MESSAGE)


class Sources(Protocol):
    """Returns the publishers on the network."""

    def origin(self, publisher: bytes) -> Origin:
        """Return the source of a publisher's samples."""
        ...

    def is_gone(self, publisher: bytes, name: str) -> bool:
        """Return whether a topic's publication has ended."""
        ...


class ForeignSubscriber(Subscriber[bytes]):  # type: ignore[type-var]
    """A subscription to payloads of a type, or of any type, with the last samples of latched publishers."""

    def __init__(self, topic: Topic[Any], transport: Transport, threaded: bool = False) -> None:
        self._any = topic.record.ROS_TYPE == ANY_TYPE
        super().__init__(
            topic,
            topic.name,
            topic.name[1:],
            transport,
            bytes,
            foreign_queue_size(topic.record.ROS_TYPE),
            latched=True,
            threaded=threaded,
        )

    def _accept(self, source: Any, origin: SampleInfo | None) -> bool:
        return self._any or super()._accept(source, origin)


class TopicOutput:
    """A publication of a script."""

    def __init__(self, name: str, ros_type: str, latched: bool, bus: Bus) -> None:
        self.name, self.ros_type, self.latched = name, ros_type, latched
        self._bus = bus
        self._sending = threading.RLock()
        """Held while sending. Reentrant, for a signal may run a shutdown hook that publishes meanwhile."""
        self._publisher: Publisher[Any] | None = None

    def bind(self, node: Node) -> None:
        """Declare the publication, once the node has its name."""
        self._publisher = node.advertise(topic_of(self.name, self.ros_type, self.latched))

    def publish(self, payload: bytes) -> None:
        self._bus.threads.point(PUBLISH)
        with self._sending:
            if (publisher := self._publisher) is not None:
                self._bus.publish(publisher, payload)

    def subscribers(self) -> list[str]:
        """Return the subscribing nodes; none while no path to any of them is known, as while two nodes are being
        linked.
        """
        return self._bus.endpoint_nodes("sub", self.name) if self.linked else []

    @property
    def linked(self) -> bool:
        """Whether published messages reach a subscriber."""
        return self._publisher is None or self._bus.links(self._publisher)

    def close(self) -> None:
        with self._sending:  # another thread's publish uses the publication
            publisher, self._publisher = self._publisher, None
            self._bus.close_output(self, publisher)


class Bus(Protocol):
    """The topics' interface to the kernel that owns them."""

    threads: Threads

    def publish(self, publisher: Publisher[Any], payload: bytes) -> None:
        """Publish a payload."""
        ...

    def endpoint_nodes(self, kind: str, name: str) -> list[str]:
        """Return the nodes with an endpoint of this kind."""
        ...

    def links(self, publisher: Publisher[Any]) -> bool:
        """Return whether a sample would reach a subscriber, whose token may be seen before the path to it is known."""
        ...

    def close_output(self, output: TopicOutput, publisher: Publisher[Any] | None) -> None:
        """Close a publication."""
        ...

    def close_input(self, given: TopicInput) -> None:
        """Close a subscription."""
        ...


class TopicInput:
    """One subscription of a script to a topic."""

    def __init__(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None, bus: Bus
    ) -> None:
        self.name, self.ros_type, self.receive, self.queue_size = name, ros_type, receive, queue_size
        self._bus = bus

    def publishers(self) -> list[str]:
        return self._bus.endpoint_nodes("pub", self.name)

    def close(self) -> None:
        self._bus.close_input(self)


class TopicReader:
    """A topic that a script subscribes to: one subscription, one worker, and all receivers in order
    of their addition.
    """

    def __init__(self, name: str, ros_type: str, threads: Threads, sources: Sources) -> None:
        self.name, self.ros_type = name, ros_type
        self.inputs: list[TopicInput] = []
        self.queue: deque[tuple[bytes, Origin, TopicInput | None]] = deque()
        self.subscriber: ForeignSubscriber | None = None
        self.worker: Worker = threads.worker(name, self._work)
        self._threads, self._sources = threads, sources
        self._log: Log | None = None
        self._latched: dict[bytes, tuple[bytes, Origin]] = {}
        self._own = b""
        self._live = False

    def bind(self, node: Node, live: bool) -> None:
        """Subscribe, once the node has its name; ``live`` reads each sample as it arrives."""
        topic = topic_of(self.name, self.ros_type)
        self._live, self._log = live, node.log
        self._own = member_id(node.identity.node, node.transport.session)
        self.subscriber = ForeignSubscriber(topic, node.transport, live)
        node.attach(self.subscriber)
        if live:
            self.worker.follow(self.subscriber.raw)  # type: ignore[arg-type]
        self.worker.notify()

    def add(self, given: TopicInput) -> None:
        """Add a receiver, which gets at once the last messages of the latched publishers that still exist."""
        self.inputs = [*self.inputs, given]
        for publisher, (payload, origin) in list(self._latched.items()):
            known = origin if origin.node else self._sources.origin(publisher)
            if known.latched and not self._sources.is_gone(publisher, self.name):
                self.queue.append((payload, known, given))
        self.worker.notify()

    def remove(self, given: TopicInput) -> None:
        """Remove a receiver."""
        self.inputs = [each for each in self.inputs if each is not given]

    def admit(self, reset: bool = False) -> None:
        """Queue the subscription's messages after its update; after a ``reset`` of time, only latched ones.

        In lockstep, the script's own messages are delivered directly.
        """
        assert self.subscriber is not None
        self._warn_refused(self.subscriber)
        for payload, info in self.subscriber.messages:
            publisher = b"" if info is None else info.publisher
            if not self._live and publisher[:MEMBER_BYTES] == self._own:
                continue
            origin = self._origin(publisher)
            if not reset or origin.latched:
                self.put(payload, origin, publisher)
        self.subscriber.messages = []

    def _origin(self, publisher: bytes) -> Origin:
        """Return the source of a sample; in real time that of a new publisher may briefly precede its token."""
        origin = self._sources.origin(publisher)
        patient = self._live and publisher and publisher not in self._latched and len(self._latched) < MOST_UNKNOWN
        if not origin.node and patient:
            self._threads.wait_until(lambda: bool(self._sources.origin(publisher).node), NEW_PUBLISHER_S)
            origin = self._sources.origin(publisher)
        return origin

    def put(self, payload: bytes, origin: Origin, publisher: bytes) -> None:
        """Queue a sample."""
        # A sample may arrive before its publisher is known.
        if origin.latched or (not origin.node and (publisher in self._latched or len(self._latched) < MOST_UNKNOWN)):
            self._latched[publisher] = payload, origin
        self.queue.append((payload, origin, None))
        self._trim()

    def _trim(self) -> None:
        """Drop the oldest messages beyond the largest queue size of the receivers."""
        sizes = [each.queue_size for each in self.inputs]
        most = QUEUE_SIZE if None in sizes or not sizes else min(max(each or 1 for each in sizes), QUEUE_SIZE)
        while len(self.queue) > most:
            self.queue.popleft()

    def _work(self) -> bool:
        """Call the receivers with the oldest message; return False if none waits."""
        if self._live and (subscriber := self.subscriber) is not None:
            subscriber.update()
            self.admit()
        if not self.queue:
            return False
        payload, origin, only = self.queue.popleft()
        for each in self.inputs:
            if only is None or only is each:
                try:
                    each.receive(payload, origin)
                except Exception:  # noqa: BLE001 - a callback that fails is logged and survived, as in ROS
                    report_exception(f"a callback of {self.name}")
        return True

    def _warn_refused(self, subscriber: ForeignSubscriber) -> None:
        if subscriber.refused and self._log is not None:
            self._log.warn(f"messages on {self.name} are refused: {subscriber.reason}", every=10.0)


class SubscriberFollower:
    """Informs a publication about nodes that begin and stop subscribing to it."""

    def __init__(
        self,
        output: TopicOutput,
        joined: Callable[[str], bytes | None] | None,
        left: Callable[[str], None] | None,
        threads: Threads,
    ) -> None:
        self.output, self._joined, self._left = output, joined, left
        self._known: set[str] = set()
        self.worker = threads.worker(f"{output.name} subscribers", self._work)

    def _work(self) -> bool:
        there = set(self.output.subscribers())
        for node in sorted(there - self._known):
            self._known.add(node)
            if self._joined is not None and (payload := self._joined(node)) is not None:
                self.output.publish(payload)
        for node in sorted(self._known - there):
            self._known.discard(node)
            if self._left is not None:
                self._left(node)
        return False
