"""The transport of one node of a container: a shared connection, on which the node waits without blocking the others.

A loop yields to the others in ``wait``, and in ``query`` until its replies have arrived. All other calls go to the
connection directly. The nodes share one subscription to each key, one publication on each, and one watch on tokens.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from itertools import islice
from typing import Any, Self

from messages.requests import MAX_REQUEST_BYTES
from messages.topics import Quality
from services.runtime.transport.api import (
    PendingReplies,
    QueryServer,
    RawPublisher,
    RawSubscriber,
    Reply,
    Sample,
    ThreadedSubscriber,
    Token,
    TokenEvent,
    TokenWatch,
    Transport,
)
from services.runtime.transport.request_queue import Refusals


class SharedConnection:
    """The subscriptions, publications and watches that the nodes of a container share on their connection.

    Latched topics are not shared: each publication keeps its own last sample, each subscription queries them.
    """

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self._patterns: dict[RawSubscriber, str] = {}
        """The keys of subscriptions that are not shared."""
        self._subscribers: dict[tuple[str, int], SharedSubscriber] = {}
        self._publishers: dict[tuple[str, str, Quality], SharedPublisher] = {}
        self._watches: dict[str, SharedWatch] = {}

    def subscribe_alone(
        self, key: str, capacity: int, latched: bool, notify: Callable[[], None] | None
    ) -> RawSubscriber:
        """Declare a subscription for one node alone."""
        made = self.transport.subscribe(key, capacity, latched, notify)
        self._patterns[made] = key
        return made

    def source(self, subscriber: RawSubscriber | None) -> tuple[RawSubscriber | None, str]:
        """Return the network subscription behind a node's, and its key; None and an empty key if there is none."""
        if isinstance(subscriber, SubscriberView):
            return subscriber.shared.raw, subscriber.shared.key
        return (subscriber, self._patterns[subscriber]) if subscriber in self._patterns else (None, "")

    def subscribe(self, key: str, capacity: int) -> SubscriberView:
        """Return a view on the samples of ``key``; one subscription receives them for all nodes."""
        what = key, capacity
        if (known := self._subscribers.get(what)) is None:
            raw = self.transport.subscribe(key, capacity)
            known = self._subscribers[what] = SharedSubscriber(key, raw, capacity, lambda: self._subscribers.pop(what))
        return known.view()

    def advertise(self, key: str, encoding: str, quality: Quality) -> SharedPublisher:
        """Return the publication on ``key`` that all nodes share."""
        what = key, encoding, quality
        if (known := self._publishers.get(what)) is None:
            raw = self.transport.advertise(key, encoding, quality)
            known = self._publishers[what] = SharedPublisher(raw, lambda: self._publishers.pop(what))
        known.users += 1
        return known

    def watch(self, pattern: str) -> WatchView:
        """Return a view on the tokens that match ``pattern``; one watch follows them for all nodes."""
        if (known := self._watches.get(pattern)) is None:
            known = self._watches[pattern] = SharedWatch(self.transport.watch(pattern))
        return known.view()


class SharedSubscriber:
    """A subscription that delivers its samples to several views."""

    def __init__(self, key: str, raw: RawSubscriber, capacity: int, ended: Callable[[], object]) -> None:
        self.key, self.raw = key, raw
        self._capacity, self._ended = capacity, ended
        self._views: list[deque[Sample]] = []

    def view(self) -> SubscriberView:
        """Add a view on the samples that arrive from now on."""
        self.update()
        made: deque[Sample] = deque(maxlen=self._capacity)
        self._views.append(made)
        return SubscriberView(self, made)

    def update(self) -> None:
        """Deliver the waiting samples to all views."""
        for sample in islice(iter(self.raw.recv, None), self._capacity):
            for view in self._views:
                view.append(sample)

    def recv_for(self, view: deque[Sample]) -> Sample | None:
        """Return the next sample for a view whose own queue is empty."""
        if len(self._views) == 1:
            return self.raw.recv()
        self.update()
        return view.popleft() if view else None

    def release(self, view: deque[Sample]) -> None:
        """Remove a view; the last one ends the subscription."""
        self._views = [each for each in self._views if each is not view]
        if not self._views:
            self.raw.close()
            self._ended()


class SubscriberView:
    """One node's view on a shared subscription."""

    def __init__(self, shared: SharedSubscriber, samples: deque[Sample]) -> None:
        self.shared, self._samples = shared, samples

    def recv(self) -> Sample | None:
        return self._samples.popleft() if self._samples else self.shared.recv_for(self._samples)

    def encoding(self, source: Any) -> str:
        return self.shared.raw.encoding(source)

    def key(self, source: Any) -> str:
        return self.shared.raw.key(source)

    def close(self) -> None:
        self.shared.release(self._samples)


class SharedPublisher:
    """A publication of several nodes; it ends when the last of them closes it."""

    def __init__(self, raw: RawPublisher, ended: Callable[[], object]) -> None:
        self.put: Any = raw.put
        self.users = 0
        self._raw, self._ended = raw, ended

    @property
    def has_subscribers(self) -> bool:
        return self._raw.has_subscribers

    def close(self) -> None:
        self.users -= 1
        if not self.users:
            self._raw.close()
            self._ended()


class SharedWatch:
    """A watch that delivers its events to several views; a new view begins with the tokens already there."""

    def __init__(self, watch: TokenWatch) -> None:
        self._watch = watch
        self._alive: dict[str, None] = {}
        self._views: list[deque[TokenEvent]] = []

    def view(self) -> WatchView:
        """Add a view."""
        self.update()
        made = deque(TokenEvent(key, True) for key in self._alive)
        self._views.append(made)
        return WatchView(self, made)

    def update(self) -> None:
        """Deliver the new events to all views."""
        while (event := self._watch.poll()) is not None:
            if event.alive:
                self._alive[event.key] = None
            else:
                self._alive.pop(event.key, None)
            for view in self._views:
                view.append(event)

    def refresh(self) -> None:
        """Query the tokens again, to report missed ones."""
        self._watch.refresh()


class WatchView:
    """One node's view on a shared watch."""

    def __init__(self, watch: SharedWatch, events: deque[TokenEvent]) -> None:
        self._watch, self._events = watch, events

    def poll(self) -> TokenEvent | None:
        self._watch.update()
        return self._events.popleft() if self._events else None

    def refresh(self) -> None:
        self._watch.refresh()


class NodeTransport:
    """A container's connection as the transport of one of its nodes.

    ``give_way`` runs the other loops until there may be work for this one; its argument is the subscription that the
    node waits for, None for a reply. It raises the error that ends a wait.
    """

    def __init__(self, shared: SharedConnection, give_way: Callable[[RawSubscriber | None], None]) -> None:
        self._shared, self._transport, self._give_way = shared, shared.transport, give_way
        self.session, self.settle_s = self._transport.session, self._transport.settle_s
        self.open = True

    @property
    def readers_version(self) -> int:
        return self._transport.readers_version

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def subscribe(
        self, key: str, capacity: int, latched: bool = False, notify: Callable[[], None] | None = None
    ) -> RawSubscriber:
        if latched or notify is not None:
            return self._shared.subscribe_alone(key, capacity, latched, notify)
        return self._shared.subscribe(key, capacity)

    def subscribe_threaded(self, key: str, capacity: int, latched: bool = False) -> ThreadedSubscriber:
        return self._transport.subscribe_threaded(key, capacity, latched)

    def advertise(self, key: str, encoding: str, quality: Quality) -> RawPublisher:
        if quality is Quality.LATCHED:
            return self._transport.advertise(key, encoding, quality)
        return self._shared.advertise(key, encoding, quality)

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> QueryServer:
        return self._transport.serve(key, largest, refusals)

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        pending = self._transport.query_async(key, payload, timeout, notify=self._transport.wake)
        while (replies := pending.poll()) is None:
            self._give_way(None)
        return replies

    def query_async(
        self,
        key: str,
        payload: bytes,
        timeout: float,
        attachment: bytes = b"",
        notify: Callable[[], None] | None = None,
    ) -> PendingReplies:
        return self._transport.query_async(key, payload, timeout, attachment, notify)

    def declare_token(self, key: str) -> Token:
        return self._transport.declare_token(key)

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        return self._transport.tokens(pattern, timeout)

    def all_tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        return self._transport.all_tokens(pattern, timeout)

    def arrived_tokens(self, pattern: str) -> set[str]:
        return self._transport.arrived_tokens(pattern)

    def watch(self, pattern: str) -> TokenWatch:
        return self._shared.watch(pattern)

    def wait(self, subscriber: RawSubscriber) -> None:
        self._give_way(subscriber)

    def wake(self) -> None:
        self._transport.wake()

    def close(self) -> None:
        """Mark this transport as closed; the connection stays open for the other nodes."""
        self.open = False
