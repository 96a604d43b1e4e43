"""What a transport in memory hands out: the bus, and the ends of it."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

from services.runtime.network.backlog import Backlog
from services.runtime.network.transport import TIMEOUT, Reply, Sample, TokenEvent

if TYPE_CHECKING:
    from services.runtime.network.memory_transport import MemoryTransport


def matches(pattern: str, key: str) -> bool:
    """Whether ``key`` lies in a key expression of ``*`` and ``**`` chunks; neither matches a chunk with a leading @."""
    return _match(pattern.split("/"), key.split("/"))


def _match(pattern: list[str], key: list[str]) -> bool:
    if not pattern or not key:
        return pattern in ([], ["**"]) and not key
    head = pattern[0]
    if head == "**":
        return _match(pattern[1:], key) or (not key[0].startswith("@") and _match(pattern, key[1:]))
    return (head == key[0] or (head == "*" and not key[0].startswith("@"))) and _match(pattern[1:], key[1:])


class MemoryBus:
    """The network that transports of one process share; every verb holds its lock."""

    def __init__(self) -> None:
        self.changed = threading.Condition(threading.RLock())
        self.inlets: list[MemoryInlet] = []
        self.latched: dict[tuple[str, int], Sample] = {}
        self.servers: list[MemoryServer] = []
        self.tokens: dict[str, int] = {}
        self.watches: list[MemoryWatch] = []
        self.numbers = itertools.count(1)

    def show(self, key: str, alive: bool) -> None:
        """Tell the watches that a token came or went."""
        with self.changed:
            for watch in self.watches:
                if matches(watch.pattern, key):
                    watch.events.append(TokenEvent(key, alive))
                    watch.owner.nudge()


class MemoryInlet:
    """A subscription on a bounded queue."""

    def __init__(self, bus: MemoryBus, key: str, capacity: int) -> None:
        self._bus, self.pattern = bus, key
        self.samples: deque[Sample] = deque(maxlen=capacity)

    def take(self) -> Sample | None:
        with self._bus.changed:
            return self.samples.popleft() if self.samples else None

    def encoding(self, source: Any) -> str:
        return str(source[0])

    def key(self, source: Any) -> str:
        return str(source[1])

    def close(self) -> None:
        with self._bus.changed:
            if self in self._bus.inlets:
                self._bus.inlets.remove(self)


class MemoryOutlet:
    """A publication."""

    def __init__(self, bus: MemoryBus, key: str, encoding: str, latched: bool) -> None:
        self._bus, self._key, self._encoding = bus, key, encoding
        self._number = next(bus.numbers) if latched else None

    def put(self, payload: bytes, *, attachment: bytes) -> None:
        sample: Sample = payload, attachment, (self._encoding, self._key)
        with self._bus.changed:
            for inlet in self._bus.inlets:
                if matches(inlet.pattern, self._key):
                    inlet.samples.append(sample)
            if self._number is not None:
                self._bus.latched[self._key, self._number] = sample
            self._bus.changed.notify_all()

    @property
    def wanted(self) -> bool:
        with self._bus.changed:
            return any(matches(inlet.pattern, self._key) for inlet in self._bus.inlets)

    def close(self) -> None:
        with self._bus.changed:
            if self._number is not None:
                self._bus.latched.pop((self._key, self._number), None)


class MemoryQuery:
    """A request and the place for its answer."""

    def __init__(self, bus: MemoryBus, key: str, payload: bytes, session: str) -> None:
        self._bus, self.key, self.payload, self._session = bus, key, payload, session
        self.answer: Reply | None = None

    def reply(self, payload: bytes) -> None:
        self._answer(Reply(True, payload, self._session))

    def refuse(self, payload: bytes) -> None:
        self._answer(Reply(False, payload, self._session))

    def _answer(self, reply: Reply) -> None:
        with self._bus.changed:
            self.answer = reply
            self._bus.changed.notify_all()


class MemoryPending:
    """A question to some servers; None without an answer when the time is up."""

    def __init__(self, asked: list[MemoryQuery], timeout: float) -> None:
        self._asked, self._deadline = asked, time.monotonic() + timeout

    def take(self) -> Sequence[Reply] | None:
        if all(each.answer for each in self._asked) or time.monotonic() > self._deadline:
            return [each.answer or Reply(False, TIMEOUT) for each in self._asked]
        return None


class MemoryServer:
    """The requests on one key."""

    def __init__(self, key: str, owner: MemoryTransport, backlog: Backlog[MemoryQuery]) -> None:
        self.key, self.owner = key, owner
        self.waiting: Collection[object] = backlog.items
        self._backlog = backlog

    def hear(self, query: MemoryQuery) -> None:
        """Called by who asks."""
        if (refusal := self._backlog.offer(query, len(query.payload))) is None:
            self.owner.nudge()
        else:
            query.refuse(refusal)

    def take(self) -> MemoryQuery | None:
        return self._backlog.take()


class MemoryWatch:
    """Liveliness events, in order."""

    def __init__(self, pattern: str, present: list[str], owner: MemoryTransport) -> None:
        self.pattern, self.owner = pattern, owner
        self.events: deque[TokenEvent] = deque(TokenEvent(key, True) for key in present)

    def take(self) -> TokenEvent | None:
        return self.events.popleft() if self.events else None

    def look(self) -> None:
        pass


class MemoryToken:
    """A liveliness token."""

    def __init__(self, bus: MemoryBus, key: str) -> None:
        self._bus, self._key = bus, key

    def close(self) -> None:
        with self._bus.changed:
            if self._bus.tokens.pop(self._key, None) is not None:
                self._bus.show(self._key, False)
