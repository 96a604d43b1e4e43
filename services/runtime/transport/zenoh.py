"""The transport on Eclipse Zenoh."""

from __future__ import annotations

import json
import os
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Self

import zenoh
from zenoh.handlers import Callback, FifoChannel, RingChannel

from messages.requests import MAX_REQUEST_BYTES
from messages.topics import Quality
from services.runtime.errors import TryAgain
from services.runtime.transport import unix_sockets
from services.runtime.transport.api import ADMIN_SPACE, TICKER_S, TIMEOUT, RawSubscriber, Reply, Sample, TokenEvent
from services.runtime.transport.request_queue import Refusals, RequestQueue

WAKE = zenoh.Encoding("elea/nudge")
"""Marks a sample that only wakes the loop."""


class ZenohSubscriber:
    """A subscription on a ring: the publisher is never blocked by a reader that is slow."""

    def __init__(self, key: str, subscriber: Any, session: str) -> None:
        self.wake_key = key.replace("**", session).replace("*", session)
        self.held: Any = None
        self.subscriber = subscriber

    def recv(self) -> Sample | None:
        sample, self.held = self.held, None
        while sample is not None or (sample := self.subscriber.try_recv()) is not None:
            if (attachment := sample.attachment) is not None:
                return sample.payload.to_bytes(), attachment.to_bytes(), sample
            if sample.encoding != WAKE:
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


class ZenohPublisher:
    """A publication. A listener tracks whether it has subscribers (asking takes 8 us); a latched one is always sent."""

    def __init__(self, publisher: Any, latched: bool = False) -> None:
        self._publisher = publisher
        self.put: Any = publisher.put  # no wrapper: this is called for every message
        self._wanted = latched
        if not latched:
            self._listener = publisher.declare_matching_listener(Callback(self._match, indirect=False))
            self._wanted = bool(publisher.matching_status.matching)

    @property
    def has_subscribers(self) -> bool:
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
    """The queries on one key. Those without room are refused in the receiving thread: the loop never sees them."""

    def __init__(self, backlog: RequestQueue[Any], nudge: Callable[[], None]) -> None:
        self.handle: Any = None
        self.waiting: Collection[object] = backlog.items
        self._backlog, self._wake = backlog, nudge

    def on_query(self, query: Any) -> None:
        """Called by Zenoh, in its own thread."""
        payload, beside = query.payload, query.attachment
        size = len(str(query.parameters)) + sum(len(part) for part in (payload, beside) if part is not None)
        if (refusal := self._backlog.offer(query, size)) is None:
            self._wake()
        else:
            with query:
                query.reply_err(refusal)

    def recv(self) -> ZenohQuery | None:
        query = self._backlog.pop()
        return None if query is None else ZenohQuery(query)


class ZenohTokenWatch:
    """Liveliness events in order, each change once: while links come up, Zenoh may report a token twice."""

    def __init__(self, ask: Callable[[], Iterable[str]]) -> None:
        self.items: deque[Any] = deque()
        self.handle: Any = None
        self._ask = ask
        self._alive: set[str] = set()
        self._found: deque[TokenEvent] = deque()

    def refresh(self) -> None:
        for key in self._ask():
            if key not in self._alive:
                self._alive.add(key)
                self._found.append(TokenEvent(key, True))

    def poll(self) -> TokenEvent | None:
        if self._found:
            return self._found.popleft()
        while self.items:
            sample = self.items.popleft()
            key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            if alive != (key in self._alive):
                (self._alive.add if alive else self._alive.discard)(key)
                return TokenEvent(key, alive)
        return None


class LivelinessCache:
    """A cache of the tokens that are visible to a peer, kept from the start of its session.

    A query of a peer gets the answer of whichever process is first: with nine peers, 4 of 324 tokens in 37 of 40 tries.
    A subscription is complete within 0.4 s of its opening.
    """

    def __init__(self) -> None:
        self._alive: set[str] = set()
        self.handle: Any = None

    def on_sample(self, sample: Any) -> None:
        (self._alive.add if sample.kind == zenoh.SampleKind.PUT else self._alive.discard)(str(sample.key_expr))

    def matching(self, pattern: str) -> set[str]:
        wanted = zenoh.KeyExpr(pattern)
        return {key for key in self._alive.copy() if wanted.includes(zenoh.KeyExpr(key))}


class ZenohPendingReplies:
    """A question under way; Zenoh closes its channel after the last answer, or when the time is up."""

    def __init__(self, replies: Any) -> None:
        self._replies = replies
        self._answers: list[Reply] = []

    def poll(self) -> list[Reply] | None:
        try:
            while (reply := self._replies.try_recv()) is not None:
                self._answers += answers(reply)
        except zenoh.ZError:
            return self._answers
        return None


def answers(reply: Any) -> list[Reply]:
    """Convert a reply of Zenoh; None if it is neither a result nor an error.

    A timeout is no server's answer, though Zenoh may report it under the client's own session.
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


# One thread receives (by default one wakes another for each message), another sends while that one waits for room. A
# router keeps to the defaults: it forwards messages, and lost large ones under load with one thread.
_THREADS = "(rx: (worker_threads: 1), acc: (handover: rx), net: (handover: rx))"

_OPENING = threading.Lock()
"""Held while a session opens: the environment belongs to all threads."""

CLOSE_S = 1.5
"""Maximum wall time [s] of leaving the network. On a dead link Zenoh needs 10 s: its sockets wait as long (SO_LINGER)
for the other side's acknowledgement. A process that ends does not wait; its tokens disappear all the same."""

_MOST_TOKENS = 1 << 20
"""Answers that a question for tokens can hold; a fleet of twelve processes has 400."""

_EVERYBODY: dict[str, Any] = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
"""Zenoh queries all servers of a key in any case; by default it returns one of their answers and hides the others."""

_DROP, _BLOCK = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK
_QUALITIES: dict[Quality, dict[str, Any]] = {
    Quality.SENSOR: {"congestion_control": _DROP, "priority": zenoh.Priority.DATA},
    Quality.COMMAND: {"congestion_control": _DROP, "priority": zenoh.Priority.REAL_TIME, "express": True},
    Quality.EVENT: {"congestion_control": _BLOCK, "priority": zenoh.Priority.DATA},
    Quality.LATCHED: {"congestion_control": _BLOCK, "priority": zenoh.Priority.DATA},
    # Not express: what waits for the sending thread gathers in one packet, and is not one packet too many.
    Quality.VITAL: {"congestion_control": _DROP, "priority": zenoh.Priority.INTERACTIVE_HIGH},
}


class ZenohTransport:
    """One Zenoh session. A single small thread nudges the loop; no other Python thread exists."""

    def __init__(self, configuration: dict[str, Any], settle_s: float = 0.7) -> None:
        self._configuration, self.settle_s = configuration, settle_s
        self._waiting: ZenohSubscriber | None = None
        self._wake_pending = False
        self._awake = threading.Event()
        self.open = True

    def __enter__(self) -> Self:
        zenoh.init_log_from_env_or("off")
        wanted, listens = (self._configuration[each]["endpoints"] for each in ("connect", "listen"))
        for each in {unix_sockets.path_of(each).parent for each in (*wanted, *listens) if unix_sockets.is_unix(each)}:
            unix_sockets.make_private(each)
        try:
            run_with_timeout(self._open)
        except zenoh.ZError as error:
            raise TryAgain(f"cannot join the network (connect {wanted}, listen {listens}): {error}") from None
        self.session = str(self._zenoh.zid())
        self._census = LivelinessCache()
        if self._configuration["mode"] != "client":  # the router answers a client, and whole
            hear = Callback(self._census.on_sample, indirect=False)
            self._census.handle = self._zenoh.liveliness().declare_subscriber(f"{ADMIN_SPACE}/**", hear, history=True)
        self._ticker = threading.Thread(target=self._run_ticker, name="nudge", daemon=True)
        self._ticker.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def subscribe(self, key: str, capacity: int, latched: bool = False) -> ZenohSubscriber:
        handler: Any = RingChannel(capacity)
        if latched:
            past = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            subscriber: Any = zenoh.ext.declare_advanced_subscriber(self._zenoh, key, handler, history=past)
        else:
            subscriber = self._zenoh.declare_subscriber(key, handler)
        return ZenohSubscriber(key, subscriber, self.session)

    def advertise(self, key: str, encoding: str, quality: Quality) -> ZenohPublisher:
        options = dict(_QUALITIES[quality], encoding=zenoh.Encoding(encoding))
        if quality is Quality.LATCHED:
            cache = zenoh.ext.CacheConfig(1)
            publisher = zenoh.ext.declare_advanced_publisher(
                self._zenoh, key, cache=cache, publisher_detection=True, **options
            )
            return ZenohPublisher(publisher, latched=True)
        return ZenohPublisher(self._zenoh.declare_publisher(key, **options))

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> ZenohServer:
        server = ZenohServer(RequestQueue(largest, refusals), self._awake.set)
        server.handle = self._zenoh.declare_queryable(key, Callback(server.on_query, indirect=False))
        return server

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        replies = self._zenoh.get(key, payload=payload, timeout=timeout, **_EVERYBODY)
        return [each for reply in replies for each in answers(reply)]

    def query_async(self, key: str, payload: bytes, timeout: float) -> ZenohPendingReplies:
        return ZenohPendingReplies(self._zenoh.get(key, payload=payload, timeout=timeout, **_EVERYBODY))

    def declare_token(self, key: str) -> ZenohToken:
        return ZenohToken(self._zenoh.liveliness().declare_token(key))

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        # With Zenoh's own FIFO, 256 deep, a get that more tokens answer than fit never returns.
        replies = self._zenoh.liveliness().get(pattern, FifoChannel(_MOST_TOKENS), timeout=timeout)
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        return sorted(found | self._census.matching(pattern))

    def watch(self, pattern: str) -> ZenohTokenWatch:
        watch = ZenohTokenWatch(lambda: self.tokens(pattern))

        def hand_over(sample: Any) -> None:
            watch.items.append(sample)
            self._awake.set()

        handler = Callback(hand_over, indirect=False)
        watch.handle = self._zenoh.liveliness().declare_subscriber(pattern, handler, history=True)
        return watch

    def wait(self, inlet: RawSubscriber) -> None:
        assert isinstance(inlet, ZenohSubscriber)
        if inlet.held is not None or self._wake_pending:
            self._wake_pending = False
            return
        self._waiting = inlet
        inlet.held = inlet.subscriber.recv()
        self._waiting = None

    def wake(self) -> None:
        self._awake.set()

    def close(self) -> None:
        if self.open:
            self.open = False
            self._awake.set()
            self._ticker.join()  # a nudge into a session that closes fails, and the thread with it
            with suppress(zenoh.ZError):  # the link was gone already
                run_with_timeout(self._close_session, CLOSE_S)

    def _open(self) -> None:
        with limit_threads(self._configuration["mode"] != "router"):
            self._zenoh = zenoh.open(zenoh.Config.from_json5(json.dumps(self._configuration)))

    def _close_session(self) -> None:
        self._zenoh.close()  # type: ignore[no-untyped-call]

    def _run_ticker(self) -> None:
        """Wake the loop when asked and ten times a second, by a sample that stays in this session."""
        while self.open:
            asked = self._awake.wait(TICKER_S)
            self._awake.clear()
            if (inlet := self._waiting) is None:
                self._wake_pending = self._wake_pending or asked
            elif self.open:
                here = zenoh.Locality.SESSION_LOCAL
                self._zenoh.put(inlet.wake_key, b"", encoding=WAKE, allowed_destination=here)


def run_with_timeout(work: Callable[[], None], seconds: float | None = None) -> None:
    """Run a blocking call of Zenoh in a thread and wait for it, ``seconds`` at most. So signals are handled
    meanwhile: Zenoh's calls let none through until they return. Raises the ZError of ``work``.
    """
    errors: list[zenoh.ZError] = []

    def run() -> None:
        try:
            work()
        except zenoh.ZError as error:
            errors.append(error)

    thread = threading.Thread(target=run, name="zenoh", daemon=True)
    thread.start()
    thread.join(seconds)
    if errors:
        raise errors[0]


@contextmanager
def limit_threads(wanted: bool = True) -> Iterator[None]:
    """Let Zenoh start with _THREADS, unless the user's environment says otherwise; children do not inherit it."""
    with _OPENING:
        ours = wanted and "ZENOH_RUNTIME" not in os.environ
        if ours:
            os.environ["ZENOH_RUNTIME"] = _THREADS
        try:
            yield
        finally:
            if ours:
                del os.environ["ZENOH_RUNTIME"]
