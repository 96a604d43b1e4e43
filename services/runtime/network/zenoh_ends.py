"""What a Zenoh session hands out: subscriptions, publications, requests and liveliness."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable
from typing import Any

import zenoh
from zenoh.handlers import Callback

from services.runtime.network.backlog import Backlog
from services.runtime.network.transport import TIMEOUT, Reply, Sample, TokenEvent

NUDGE = zenoh.Encoding("elea/nudge")
"""Marks a sample that only wakes the loop."""


class ZenohInlet:
    """A subscription on a ring: the publisher is never blocked by a reader that is slow."""

    def __init__(self, key: str, subscriber: Any, session: str) -> None:
        self.nudge_key = key.replace("**", session).replace("*", session)
        self.held: Any = None
        self.subscriber = subscriber

    def take(self) -> Sample | None:
        sample, self.held = self.held, None
        while sample is not None or (sample := self.subscriber.try_recv()) is not None:
            if (attachment := sample.attachment) is not None:
                return sample.payload.to_bytes(), attachment.to_bytes(), sample
            if sample.encoding != NUDGE:
                return sample.payload.to_bytes(), b"", sample
            sample = None
        return None

    def encoding(self, source: Any) -> str:
        name = str(source.encoding)
        return "" if name == "zenoh/bytes" else name

    def key(self, source: Any) -> str:
        return str(source.key_expr)

    def close(self) -> None:
        self.subscriber.undeclare()


class ZenohOutlet:
    """A publication. A listener follows whether it is wanted (asking takes 8 us); what is latched always is."""

    def __init__(self, publisher: Any, latched: bool = False) -> None:
        self._publisher = publisher
        self.put: Any = publisher.put  # no wrapper: this is called for every message
        self._wanted = latched
        if not latched:
            self._listener = publisher.declare_matching_listener(Callback(self._match, indirect=False))
            self._wanted = bool(publisher.matching_status.matching)

    @property
    def wanted(self) -> bool:
        return self._wanted

    def close(self) -> None:
        self._publisher.undeclare()

    def _match(self, status: Any) -> None:
        self._wanted = bool(status.matching)


class ZenohQuery:
    """A request; it counts as finished once it is answered."""

    def __init__(self, query: Any) -> None:
        self._query = query
        self.key = str(query.key_expr)
        self.payload: bytes = query.payload.to_bytes() if query.payload is not None else b""

    def reply(self, payload: bytes) -> None:
        with self._query:
            self._query.reply(self._query.key_expr, payload)

    def refuse(self, payload: bytes) -> None:
        with self._query:
            self._query.reply_err(payload)


class ZenohServer:
    """The requests on one key. What finds no room is refused where it is received: the loop never sees it."""

    def __init__(self, backlog: Backlog[Any], nudge: Callable[[], None]) -> None:
        self.handle: Any = None
        self.waiting: Collection[object] = backlog.items
        self._backlog, self._nudge = backlog, nudge

    def hear(self, query: Any) -> None:
        """Called by Zenoh, in its own thread."""
        payload, beside = query.payload, query.attachment
        size = len(str(query.parameters)) + sum(len(part) for part in (payload, beside) if part is not None)
        if (refusal := self._backlog.offer(query, size)) is None:
            self._nudge()
        else:
            with query:
                query.reply_err(refusal)

    def take(self) -> ZenohQuery | None:
        query = self._backlog.take()
        return None if query is None else ZenohQuery(query)


class ZenohWatch:
    """Liveliness events, in order, each change once: while links come up, Zenoh may tell of a token twice."""

    def __init__(self, ask: Callable[[], Iterable[str]]) -> None:
        self.items: deque[Any] = deque()
        self.handle: Any = None
        self._ask = ask
        self._alive: set[str] = set()
        self._found: deque[TokenEvent] = deque()

    def look(self) -> None:
        for key in self._ask():
            if key not in self._alive:
                self._alive.add(key)
                self._found.append(TokenEvent(key, True))

    def take(self) -> TokenEvent | None:
        if self._found:
            return self._found.popleft()
        while self.items:
            sample = self.items.popleft()
            key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            if alive != (key in self._alive):
                (self._alive.add if alive else self._alive.discard)(key)
                return TokenEvent(key, alive)
        return None


class ZenohCensus:
    """The tokens in a peer's sight, kept from its first moment.

    A peer that asks gets the answer of whoever answers first: with nine fellows, 4 of 324 tokens in 37 of 40 tries.
    What it is told as a subscriber is complete, within 0.4 s of its opening.
    """

    def __init__(self) -> None:
        self._alive: set[str] = set()
        self.handle: Any = None

    def hear(self, sample: Any) -> None:
        (self._alive.add if sample.kind == zenoh.SampleKind.PUT else self._alive.discard)(str(sample.key_expr))

    def matching(self, pattern: str) -> set[str]:
        wanted = zenoh.KeyExpr(pattern)
        return {key for key in self._alive.copy() if wanted.includes(zenoh.KeyExpr(key))}


class ZenohPending:
    """A question under way; Zenoh closes its channel after the last answer, or when the time is up."""

    def __init__(self, replies: Any) -> None:
        self._replies = replies
        self._answers: list[Reply] = []

    def take(self) -> list[Reply] | None:
        try:
            while (reply := self._replies.try_recv()) is not None:
                self._answers += answers(reply)
        except zenoh.ZError:
            return self._answers
        return None


def answers(reply: Any) -> list[Reply]:
    """A reply of Zenoh as ours; none when it is neither result nor error.

    That nobody answered in time is not a server's word, though Zenoh may tell it in the asker's own name.
    """
    session = "" if reply.replier_id is None else str(reply.replier_id.zid)
    if reply.ok is not None:
        return [Reply(True, reply.ok.payload.to_bytes(), session)]
    if reply.err is None:
        return []
    payload = reply.err.payload.to_bytes()
    return [Reply(False, payload, "" if payload == TIMEOUT else session)]


class ZenohToken:
    """A liveliness token."""

    def __init__(self, token: Any) -> None:
        self._token = token

    def close(self) -> None:
        self._token.undeclare()
