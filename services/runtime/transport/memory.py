"""The in-memory transport, for tests of loops without processes; it passes the same conformance suite as Zenoh's."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from typing import Any, Self

from messages.requests import MAX_REQUEST_BYTES
from messages.topics import Quality
from services.runtime.errors import BadInput
from services.runtime.transport.api import TICKER_S, TIMEOUT, RawSubscriber, Reply, Sample, TokenEvent
from services.runtime.transport.request_queue import Refusals, RequestQueue


def matches(pattern: str, key: str) -> bool:
    """Return whether ``key`` matches an expression with ``*`` and ``**``, which match no chunk with a leading @."""
    return pattern == key or ("*" in pattern and _matches_chunks(pattern, key))


@lru_cache(1 << 14)
def _matches_chunks(pattern: str, key: str) -> bool:
    return _match(pattern.split("/"), key.split("/"))


def _match(pattern: list[str], key: list[str]) -> bool:
    if not pattern or not key:
        return pattern in ([], ["**"]) and not key
    head = pattern[0]
    if head == "**":
        return _match(pattern[1:], key) or (not key[0].startswith("@") and _match(pattern, key[1:]))
    return (head == key[0] or (head == "*" and not key[0].startswith("@"))) and _match(pattern[1:], key[1:])


class MemoryBus:
    """The network that transports of one process share; every operation holds its lock."""

    def __init__(self) -> None:
        self.changed = threading.Condition(threading.RLock())
        self.subscribers: list[MemorySubscriber] = []
        self.latched: dict[tuple[str, int], Sample] = {}
        self.servers: list[MemoryServer] = []
        self.tokens: dict[str, int] = {}
        self.watches: list[MemoryTokenWatch] = []
        self.numbers = itertools.count(1)
        self.readers_version = 0
        """Incremented by each subscription that begins or ends."""

    def set_token(self, key: str, alive: bool) -> None:
        """Notify the watches that a token appeared or disappeared."""
        with self.changed:
            for watch in self.watches:
                if matches(watch.pattern, key):
                    watch.events.append(TokenEvent(key, alive))
                    watch.owner.wake()


class MemorySubscriber:
    """A subscription on a bounded queue."""

    def __init__(self, bus: MemoryBus, key: str, capacity: int, notify: Callable[[], None] | None = None) -> None:
        self._bus, self.pattern, self.notify = bus, key, notify
        self.samples: deque[Sample] = deque(maxlen=capacity)
        self._woken, self._open = False, True

    def recv(self) -> Sample | None:
        with self._bus.changed:
            return self.samples.popleft() if self.samples else None

    def encoding(self, source: Any) -> str:
        return str(source[0])

    def key(self, source: Any) -> str:
        return str(source[1])

    def wait(self) -> bool:
        with self._bus.changed:
            self._bus.changed.wait_for(lambda: bool(self.samples) or self._woken or not self._open)
            self._woken = False
            return self._open

    def wake(self) -> None:
        with self._bus.changed:
            self._woken = True
            self._bus.changed.notify_all()

    def close(self) -> None:
        with self._bus.changed:
            self._open = False
            if self in self._bus.subscribers:
                self._bus.subscribers.remove(self)
                self._bus.readers_version += 1
            self._bus.changed.notify_all()


class MemoryPublisher:
    """A publication."""

    def __init__(self, bus: MemoryBus, key: str, encoding: str, latched: bool) -> None:
        self._bus, self._key, self._encoding = bus, key, encoding
        self._number = next(bus.numbers) if latched else None

    def put(self, payload: bytes, *, attachment: bytes) -> None:
        sample: Sample = payload, attachment, (self._encoding, self._key)
        with self._bus.changed:
            for subscriber in self._bus.subscribers:
                if matches(subscriber.pattern, self._key):
                    subscriber.samples.append(sample)
                    if subscriber.notify is not None:
                        subscriber.notify()
            if self._number is not None:
                self._bus.latched[self._key, self._number] = sample
            self._bus.changed.notify_all()

    @property
    def has_subscribers(self) -> bool:
        with self._bus.changed:
            return any(matches(subscriber.pattern, self._key) for subscriber in self._bus.subscribers)

    def close(self) -> None:
        with self._bus.changed:
            if self._number is not None:
                self._bus.latched.pop((self._key, self._number), None)


class MemoryQuery:
    """A request and its reply, once it has one."""

    def __init__(
        self,
        bus: MemoryBus,
        key: str,
        payload: bytes,
        session: str,
        attachment: bytes = b"",
        notify: Callable[[], None] | None = None,
    ) -> None:
        self._bus, self.key, self.payload, self._session, self._notify = bus, key, payload, session, notify
        self.attachment = attachment
        self.answer: Reply | None = None

    def reply(self, payload: bytes) -> None:
        self._answer(Reply(True, payload, self._session))

    def refuse(self, payload: bytes) -> None:
        self._answer(Reply(False, payload, self._session))

    def _answer(self, reply: Reply) -> None:
        with self._bus.changed:
            self.answer = reply
            if self._notify is not None:
                self._notify()
            self._bus.changed.notify_all()


class MemoryPendingReplies:
    """A query to several servers."""

    def __init__(self, asked: list[MemoryQuery], timeout: float) -> None:
        self._asked, self._deadline = asked, time.monotonic() + timeout

    def poll(self) -> Sequence[Reply] | None:
        if all(each.answer for each in self._asked) or time.monotonic() > self._deadline:
            return _replies(self._asked)
        return None

    def received(self) -> Sequence[Reply]:
        return [each.answer for each in self._asked if each.answer]


def _replies(asked: Collection[MemoryQuery]) -> list[Reply]:
    """Return the replies, and one TIMEOUT if any is missing."""
    received = [each.answer for each in asked if each.answer]
    return received if len(received) == len(asked) else [*received, Reply(False, TIMEOUT)]


class MemoryServer:
    """The requests on one key."""

    def __init__(self, key: str, owner: MemoryTransport, backlog: RequestQueue[MemoryQuery]) -> None:
        self.key, self.owner = key, owner
        self.waiting: Collection[object] = backlog.items
        self._backlog = backlog

    def on_query(self, query: MemoryQuery) -> None:
        """Queue a query; called by the client."""
        if (refusal := self._backlog.offer(query, len(query.payload) + len(query.attachment))) is None:
            self.owner.wake()
        else:
            query.refuse(refusal)

    def recv(self) -> MemoryQuery | None:
        return self._backlog.pop()

    def close(self) -> None:
        with self.owner.bus.changed:
            if self in self.owner.bus.servers:
                self.owner.bus.servers.remove(self)


class MemoryTokenWatch:
    """Liveliness events, in order."""

    def __init__(self, pattern: str, present: list[str], owner: MemoryTransport) -> None:
        self.pattern, self.owner = pattern, owner
        self.events: deque[TokenEvent] = deque(TokenEvent(key, True) for key in present)

    def poll(self) -> TokenEvent | None:
        return self.events.popleft() if self.events else None

    def refresh(self) -> None:
        pass


class MemoryToken:
    """A liveliness token."""

    def __init__(self, bus: MemoryBus, key: str) -> None:
        self._bus, self._key = bus, key

    def close(self) -> None:
        with self._bus.changed:
            if self._bus.tokens.pop(self._key, None) is not None:
                self._bus.set_token(self._key, False)


class MemoryTransport:
    """One connection to a MemoryBus."""

    settle_s = 0.0

    def __init__(self, bus: MemoryBus) -> None:
        self.bus = bus
        self.session = f"{next(bus.numbers):032x}"
        self.open = True
        self._woken = False
        self._waiting: MemorySubscriber | None = None
        self._owned: list[MemorySubscriber | MemoryPublisher | MemoryToken] = []
        self._servers: list[MemoryServer] = []

    @property
    def readers_version(self) -> int:
        """Incremented by each subscription of the bus that begins or ends."""
        return self.bus.readers_version

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def subscribe_threaded(self, key: str, capacity: int, latched: bool = False) -> MemorySubscriber:
        return self.subscribe(key, capacity, latched)

    def subscribe(
        self, key: str, capacity: int, latched: bool = False, notify: Callable[[], None] | None = None
    ) -> MemorySubscriber:
        subscriber = MemorySubscriber(self.bus, key, capacity, notify)
        with self.bus.changed:
            if latched:
                subscriber.samples.extend(each for each in self.bus.latched.values() if matches(key, each[2][1]))
                if subscriber.samples and notify is not None:
                    notify()
            self.bus.subscribers.append(subscriber)
            self.bus.readers_version += 1
        self._owned.append(subscriber)
        return subscriber

    def advertise(self, key: str, encoding: str, quality: Quality) -> MemoryPublisher:
        if "*" in key:
            raise BadInput(f"cannot publish on {key!r}: a publication has no wildcards")
        publisher = MemoryPublisher(self.bus, key, encoding, quality is Quality.LATCHED)
        self._owned.append(publisher)
        return publisher

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> MemoryServer:
        server = MemoryServer(key, self, RequestQueue(largest, refusals))
        with self.bus.changed:
            self.bus.servers.append(server)
        self._servers.append(server)
        return server

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        with self.bus.changed:
            asked = self._send_query(key, payload)
            self.bus.changed.wait_for(lambda: all(each.answer for each in asked), timeout)
        return _replies(asked)

    def query_async(
        self,
        key: str,
        payload: bytes,
        timeout: float,
        attachment: bytes = b"",
        notify: Callable[[], None] | None = None,
    ) -> MemoryPendingReplies:
        with self.bus.changed:
            return MemoryPendingReplies(self._send_query(key, payload, attachment, notify), timeout)

    def declare_token(self, key: str) -> MemoryToken:
        token = MemoryToken(self.bus, key)
        with self.bus.changed:
            self.bus.tokens[key] = 1
            self.bus.set_token(key, True)
        self._owned.append(token)
        return token

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        with self.bus.changed:
            return sorted(key for key in self.bus.tokens if matches(pattern, key))

    def all_tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        return self.tokens(pattern)

    def arrived_tokens(self, pattern: str) -> set[str]:
        return set(self.tokens(pattern))

    def watch(self, pattern: str) -> MemoryTokenWatch:
        with self.bus.changed:
            watch = MemoryTokenWatch(pattern, self.tokens(pattern), self)
            self.bus.watches.append(watch)
        return watch

    def subscribed(self) -> set[str]:
        """Return the keys of all subscriptions on the bus."""
        with self.bus.changed:
            return {each.pattern for each in self.bus.subscribers}

    def wait(self, subscriber: RawSubscriber) -> None:
        assert isinstance(subscriber, MemorySubscriber)
        with self.bus.changed:
            self._waiting = subscriber
            self.bus.changed.notify_all()
            self.bus.changed.wait_for(lambda: bool(subscriber.samples) or self._woken, TICKER_S)
            self._waiting, self._woken = None, False

    def wait_idle(self, timeout: float) -> bool:
        """Block until the loop waits with nothing to do; False after ``timeout`` [s]. Called from another thread."""
        with self.bus.changed:
            return self.bus.changed.wait_for(
                lambda: self._waiting is not None and not self._waiting.samples and not self._woken, timeout
            )

    def wake(self) -> None:
        with self.bus.changed:
            self._woken = True
            self.bus.changed.notify_all()

    def close(self) -> None:
        self.open = False
        for each in self._owned:
            each.close()
        with self.bus.changed:
            self.bus.servers = [each for each in self.bus.servers if each not in self._servers]

    def _send_query(
        self, key: str, payload: bytes, attachment: bytes = b"", notify: Callable[[], None] | None = None
    ) -> list[MemoryQuery]:
        asked = []
        for server in self.bus.servers:
            if matches(server.key, key):
                query = MemoryQuery(self.bus, key, payload, server.owner.session, attachment, notify)
                asked.append(query)
                server.on_query(query)
        return asked
