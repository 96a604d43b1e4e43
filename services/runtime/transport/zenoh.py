"""The transport on Eclipse Zenoh."""

from __future__ import annotations

import itertools
import json
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Self

import zenoh
from zenoh.handlers import Callback, FifoChannel, RingChannel

from messages.requests import MAX_REQUEST_BYTES
from messages.topics import Quality
from services.runtime.errors import TryAgain
from services.runtime.transport import unix_sockets
from services.runtime.transport.api import (
    ADMIN_SPACE,
    TICKER_S,
    TIMEOUT,
    PendingReplies,
    RawPublisher,
    RawSubscriber,
    Reply,
    Sample,
    TokenEvent,
)
from services.runtime.transport.latching import LatchedPast, Latching, unpack_sample
from services.runtime.transport.peer_links import PeerLinks
from services.runtime.transport.request_queue import Refusals, RequestQueue

WAKE = zenoh.Encoding("elea/nudge")
"""Marks a sample that only wakes the loop."""
_RELEASE_S = 10.0
"""Wall time [s] within which a woken thread must have left its wait for a sample, also on a busy machine."""
_RELEASE_POLL_S = 0.001


class ZenohSubscriber:
    """A subscription with a ring: a slow subscriber never blocks the publisher."""

    def __init__(self, key: str, subscriber: Any, session: str, past: LatchedPast | None = None) -> None:
        self.wake_key = key.replace("**", session).replace("*", session)
        self.held: Any = None
        self.subscriber = subscriber
        self._past = past

    def recv(self) -> Sample | None:
        return self._take() if self._past is None else self._past.next(self._take)

    def _take(self) -> Sample | None:
        """Return the next sent sample, without wake-ups."""
        sample, self.held = self.held, None
        while sample is not None or (sample := self.subscriber.try_recv()) is not None:
            if (attachment := sample.attachment) is not None:
                return sample.payload.to_bytes(), attachment.to_bytes(), sample
            if sample.encoding != WAKE:
                return sample.payload.to_bytes(), b"", sample
            sample = None
        return None

    def encoding(self, source: Any) -> str:
        return _encoding_of(source)

    def key(self, source: Any) -> str:
        return str(source.key_expr)

    def close(self) -> None:
        if self._past is not None:
            self._past.close()
        self.subscriber.undeclare()


class ZenohNotifyingSubscriber:
    """A subscription whose samples arrive in a thread of Zenoh, which calls ``notify``."""

    def __init__(self, capacity: int, notify: Callable[[], None], past: LatchedPast | None = None) -> None:
        self.subscriber: Any = None
        self._past = past
        self._samples: deque[Any] = deque(maxlen=capacity)
        self._notify = notify

    def on_sample(self, sample: Any) -> None:
        """Queue a sample and notify; called by Zenoh in its own thread."""
        self._samples.append(sample)
        self._notify()

    def recv(self) -> Sample | None:
        return self._take() if self._past is None else self._past.next(self._take)

    def _take(self) -> Sample | None:
        return unpack_sample(self._samples.popleft()) if self._samples else None

    def encoding(self, source: Any) -> str:
        return _encoding_of(source)

    def key(self, source: Any) -> str:
        return str(source.key_expr)

    def close(self) -> None:
        if self._past is not None:
            self._past.close()
        self.subscriber.undeclare()


class ZenohThreadedSubscriber(ZenohSubscriber):
    """A subscription with a ring, on whose channel a thread waits: no Python runs in the network's threads for it.

    A callback that passes samples on makes a round trip a quarter longer, and takes 1.4 times the processor time.
    """

    def __init__(
        self, key: str, subscriber: Any, session: str, put: Callable[..., None], past: LatchedPast | None = None
    ) -> None:
        super().__init__(key, subscriber, session, past)
        self._put = put
        self._closing = False

    def _take(self) -> Sample | None:
        try:
            return super()._take()
        except (zenoh.ZError, RuntimeError) as error:
            self._check_closed(error)
            return None

    def wait(self) -> bool:
        if self.held is None and (self._past is None or self._past.held is None):
            try:
                self.held = self.subscriber.recv()
            except (zenoh.ZError, RuntimeError) as error:
                self._check_closed(error)
                return False
        return True

    def _check_closed(self, error: Exception) -> None:
        """Raise an error unless it means that the session has closed, or that another thread ends the subscription."""
        if isinstance(error, RuntimeError) and not self._closing:  # "Already mutably borrowed"
            raise error

    def close(self) -> None:
        """Wake the thread until it has left ``recv``, which borrows the subscriber, then end the subscription."""
        self._closing = True
        if self._past is not None:
            self._past.close()
        deadline = time.monotonic() + _RELEASE_S
        while True:
            try:
                self.subscriber.undeclare()
                return
            except RuntimeError:  # "Already borrowed"
                if time.monotonic() > deadline:
                    raise
            self.wake()
            time.sleep(_RELEASE_POLL_S)

    def wake(self) -> None:
        with suppress(zenoh.ZError):  # the session has closed, which ended the wait
            self._put(self.wake_key, b"", encoding=WAKE, allowed_destination=zenoh.Locality.SESSION_LOCAL)


def _encoding_of(sample: Any) -> str:
    name = str(sample.encoding)
    return "" if name == "zenoh/bytes" else name


class ZenohPublisher:
    """A publication. A listener tracks whether it has subscribers, since a query takes 8 us. ``changed`` is called
    after each change, in a thread of Zenoh."""

    def __init__(self, publisher: Any, changed: Callable[[], None]) -> None:
        self._publisher, self._changed = publisher, changed
        self.put: Any = publisher.put  # no wrapper: this is called for every message
        self._changed_to: bool | None = None
        """The latest report of the listener, which is newer than ``_first``, even if it arrives earlier."""
        self._listener = publisher.declare_matching_listener(Callback(self._on_matching, indirect=False))
        self._first = bool(publisher.matching_status.matching)

    @property
    def has_subscribers(self) -> bool:
        changed_to = self._changed_to
        return self._first if changed_to is None else changed_to

    def close(self) -> None:
        self._publisher.undeclare()

    def _on_matching(self, status: Any) -> None:
        self._changed_to = bool(status.matching)
        self._changed()


class ZenohQuery:
    """A request; Zenoh finishes it once it is answered."""

    def __init__(self, query: Any) -> None:
        self._query = query
        self.key = str(query.key_expr)
        self.payload: bytes = query.payload.to_bytes() if query.payload is not None else b""
        self.attachment: bytes = query.attachment.to_bytes() if query.attachment is not None else b""

    def reply(self, payload: bytes) -> None:
        with self._query:
            self._query.reply(self._query.key_expr, payload)

    def refuse(self, payload: bytes) -> None:
        with self._query:
            self._query.reply_err(payload)


class ZenohServer:
    """The queries on one key. Those that do not fit are refused in the receiving thread: the loop never sees them."""

    def __init__(self, backlog: RequestQueue[Any], wake: Callable[[], None]) -> None:
        self.handle: Any = None
        self.waiting: Collection[object] = backlog.items
        self._backlog, self._wake = backlog, wake

    def on_query(self, query: Any) -> None:
        """Queue or refuse a query; called by Zenoh in its own thread."""
        payload, attachment = query.payload, query.attachment
        size = len(str(query.parameters)) + sum(len(part) for part in (payload, attachment) if part is not None)
        if (refusal := self._backlog.offer(query, size)) is None:
            self._wake()
        else:
            with query:
                query.reply_err(refusal)

    def recv(self) -> ZenohQuery | None:
        query = self._backlog.pop()
        return None if query is None else ZenohQuery(query)

    def close(self) -> None:
        self.handle.undeclare()


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
    """A cache of the tokens visible to a peer, kept from the start of its session.

    A peer's query returns the answer of whichever process is first: with nine peers, 4 of 324 tokens in 37 of 40 tries.
    A subscription is complete within 0.4 s after it is opened. Changes wait in a channel for ``update``: a callback for
    each of the thousands of a large fleet would block the receiving thread whenever another thread computes.
    """

    def __init__(self) -> None:
        self.news: Any = None
        self._alive: dict[str, set[str]] = {}
        """The tokens of each kind (the third chunk)."""
        # Reentrant, for a signal may run a program's shutdown hook while the main thread holds it.
        self._lock = threading.RLock()

    def update(self) -> None:
        """Apply the changes received since the last call."""
        if self.news is None:
            return
        with self._lock:
            while (sample := self.news.try_recv()) is not None:
                key = str(sample.key_expr)
                alive = self._alive.setdefault(_kind(key), set())
                (alive.add if sample.kind == zenoh.SampleKind.PUT else alive.discard)(key)

    def matching(self, pattern: str) -> set[str]:
        """Return the visible tokens that match a pattern."""
        self.update()
        expression, kind = zenoh.KeyExpr(pattern), _kind(pattern)
        with self._lock:
            tokens = [key for each, keys in self._alive.items() if kind in (each, "", "*", "**") for key in keys]
        return {key for key in tokens if expression.includes(zenoh.KeyExpr(key))}


def _kind(token: str) -> str:
    """Return the third chunk of a token or a pattern, or an empty text."""
    chunks = token.split("/", 3)
    return chunks[2] if len(chunks) > 2 and "**" not in chunks[:2] else ""


class ZenohPendingReplies:
    """A pending query; Zenoh closes its channel after the last reply or at the timeout."""

    def __init__(self, replies: Any) -> None:
        self._replies = replies
        self._answers: list[Reply] = []

    def poll(self) -> list[Reply] | None:
        try:
            while (reply := self._replies.try_recv()) is not None:
                self._answers += answers(reply)
        except zenoh.ZError:
            return _with_one_timeout(self._answers)
        return None

    def received(self) -> list[Reply]:
        self.poll()
        return _of_servers(self._answers)


class ZenohNotifyingReplies:
    """A pending query whose replies are collected in a thread of Zenoh, which calls ``notify`` at the end."""

    def __init__(self, notify: Callable[[], None]) -> None:
        self._answers: list[Reply] = []
        self._complete = False
        self._notify = notify

    def on_reply(self, reply: Any) -> None:
        """Add a reply; called by Zenoh in its own thread."""
        self._answers += answers(reply)

    def on_end(self) -> None:
        """Notify that all replies have arrived; called by Zenoh in its own thread."""
        self._complete = True
        self._notify()

    def poll(self) -> list[Reply] | None:
        return _with_one_timeout(self._answers) if self._complete else None

    def received(self) -> list[Reply]:
        return _of_servers(self._answers)


def _of_servers(replies: Iterable[Reply]) -> list[Reply]:
    return [each for each in replies if each.ok or each.payload != TIMEOUT]


def _with_one_timeout(replies: list[Reply]) -> list[Reply]:
    """Return the replies with at most one TIMEOUT: the router and this session may both report a missing reply."""
    received = _of_servers(replies)
    return received if len(received) == len(replies) else [*received, Reply(False, TIMEOUT)]


def answers(reply: Any) -> list[Reply]:
    """Convert a reply of Zenoh; returns an empty list if it is neither a result nor an error.

    A timeout is not a server's reply, though Zenoh may report it under the client's own session.
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


# One thread receives (by default one wakes another for each message), another sends while that one waits for space. A
# client has a third for everything else: it ends queries that were not answered in time, and waits for space to do so.
# Done in the receiving thread, this blocked a simulation, then its router, which had 100 nodes to announce to it, and
# so the whole fleet. A peer has no third: ``lab`` is a tenth slower with it. A router keeps the defaults: it forwards
# messages, and lost large ones under load with one thread.
_THREADS = {
    "peer": "(rx: (worker_threads: 1), net: (handover: rx), acc: (handover: rx))",
    "client": "(rx: (worker_threads: 1), net: (worker_threads: 1), acc: (handover: net))",
}

_OPENING = threading.Lock()
"""Held while a session opens: all threads share the environment."""

CLOSE_S = 3.0
"""Maximum wall time [s] of leaving the network. On a dead link Zenoh needs 10 s: its sockets wait that long (SO_LINGER)
for the other side's acknowledgement. An ending process does not wait; its tokens disappear all the same."""

_MOST_TOKENS = 1 << 20
"""Maximum replies to a query for tokens; a fleet of twelve processes has 400."""
_TOKENS_S = 0.002
"""Wall time for which the loop is not woken after a token: the tokens of a node arrive together, and wake it once."""

_EVERYBODY: dict[str, Any] = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
"""Zenoh queries all servers of a key in any case; by default it returns one of their answers and hides the others."""

_DROP, _BLOCK = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK
_QUALITIES: dict[Quality, dict[str, Any]] = {
    Quality.SENSOR: {"congestion_control": _DROP, "priority": zenoh.Priority.DATA},
    Quality.COMMAND: {"congestion_control": _DROP, "priority": zenoh.Priority.REAL_TIME, "express": True},
    Quality.EVENT: {"congestion_control": _BLOCK, "priority": zenoh.Priority.DATA},
    Quality.LATCHED: {"congestion_control": _BLOCK, "priority": zenoh.Priority.DATA},
    # Not express: messages that wait for the sending thread share one packet.
    Quality.VITAL: {"congestion_control": _DROP, "priority": zenoh.Priority.INTERACTIVE_HIGH},
}


class ZenohTransport:
    """One Zenoh session. A small thread wakes the loop; with latched topics, another queries and answers."""

    def __init__(self, configuration: dict[str, Any], settle_s: float = 0.7) -> None:
        self._configuration, self.settle_s = configuration, settle_s
        self._waiting: ZenohSubscriber | None = None
        self._wake_pending = False
        self._awake = threading.Event()
        self._tokens_arrive = False
        self._peer_links: PeerLinks | None = None
        self._readers_versions = itertools.count(1)
        self.readers_version = 0
        self.open = True

    def __enter__(self) -> Self:
        zenoh.init_log_from_env_or("off")
        connects, listens = (self._configuration[each]["endpoints"] for each in ("connect", "listen"))
        for each in {unix_sockets.path_of(each).parent for each in (*connects, *listens) if unix_sockets.is_unix(each)}:
            unix_sockets.make_private(each)
        try:
            run_with_timeout(self._open)
        except zenoh.ZError as error:
            raise TryAgain(f"cannot join the network (connect {connects}, listen {listens}): {error}") from None
        self.session = str(self._zenoh.zid())
        self._latching = Latching(self._zenoh)
        self._liveliness = LivelinessCache()
        if self._configuration["mode"] != "client":  # a client gets complete answers, from the router
            news: Any = FifoChannel(_MOST_TOKENS)
            self._liveliness.news = self._zenoh.liveliness().declare_subscriber(f"{ADMIN_SPACE}/**", news, history=True)
        if self._configuration["mode"] == "peer":
            self._peer_links = PeerLinks(self._zenoh, self._configuration, open_session)
        self._ticker = threading.Thread(target=self._run_ticker, name="ticker", daemon=True)
        self._ticker.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def subscribe(
        self, key: str, capacity: int, latched: bool = False, notify: Callable[[], None] | None = None
    ) -> RawSubscriber:
        past = self._latching.past() if latched else None
        made: ZenohSubscriber | ZenohNotifyingSubscriber
        if notify is None:
            declared = self._zenoh.declare_subscriber(key, RingChannel(capacity))
            made = ZenohSubscriber(key, declared, self.session, past)
        else:
            made = ZenohNotifyingSubscriber(capacity, notify, past)
            made.subscriber = self._zenoh.declare_subscriber(key, Callback(made.on_sample, indirect=False))
        if past is not None:
            past.follow(key, notify or self._awake.set)
        return made

    def subscribe_threaded(self, key: str, capacity: int, latched: bool = False) -> ZenohThreadedSubscriber:
        past = self._latching.past() if latched else None
        declared = self._zenoh.declare_subscriber(key, RingChannel(capacity))
        made = ZenohThreadedSubscriber(key, declared, self.session, self._zenoh.put, past)
        if past is not None:
            past.follow(key, made.wake)
        return made

    def advertise(self, key: str, encoding: str, quality: Quality) -> RawPublisher:
        options = dict(_QUALITIES[quality], encoding=zenoh.Encoding(encoding))
        publisher = self._zenoh.declare_publisher(key, **options)
        if quality is Quality.LATCHED:
            return self._latching.publisher(publisher)
        return ZenohPublisher(publisher, self._count_readers_change)

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> ZenohServer:
        server = ZenohServer(RequestQueue(largest, refusals), self._awake.set)
        server.handle = self._zenoh.declare_queryable(key, Callback(server.on_query, indirect=False))
        return server

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        replies = self._zenoh.get(key, payload=payload, timeout=timeout, **_EVERYBODY)
        return _with_one_timeout([each for reply in replies for each in answers(reply)])

    def query_async(
        self,
        key: str,
        payload: bytes,
        timeout: float,
        attachment: bytes = b"",
        notify: Callable[[], None] | None = None,
    ) -> PendingReplies:
        terms = {"payload": payload, "timeout": timeout, "attachment": attachment or None, **_EVERYBODY}
        if notify is None:
            return ZenohPendingReplies(self._zenoh.get(key, **terms))
        made = ZenohNotifyingReplies(notify)
        self._zenoh.get(key, Callback(made.on_reply, made.on_end, indirect=False), **terms)
        return made

    def declare_token(self, key: str) -> ZenohToken:
        return ZenohToken(self._zenoh.liveliness().declare_token(key))

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        return self._ask_for_tokens(pattern, timeout)[0]

    def all_tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        found, complete = self._ask_for_tokens(pattern, timeout)
        if not complete:
            raise TryAgain(
                f"the network did not list its nodes within {timeout:g} s: is its router stopped, or the machine "
                "overloaded?"
            )
        return found

    def arrived_tokens(self, pattern: str) -> set[str]:
        if self._configuration["mode"] == "client":
            # The router has passed on what a session declared before it answers for its token.
            return set(self.tokens(pattern))
        return self._liveliness.matching(pattern)

    def _ask_for_tokens(self, pattern: str, timeout: float) -> tuple[list[str], bool]:
        """Return the tokens known within ``timeout`` [s], and whether they are complete."""
        # With Zenoh's default FIFO of 256, a get with more replies than fit never returns.
        replies = [*self._zenoh.liveliness().get(pattern, FifoChannel(_MOST_TOKENS), timeout=timeout)]
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        late = any(reply.err is not None and reply.err.payload.to_bytes() == TIMEOUT for reply in replies)
        # A client without a link to its router gets an empty answer at once.
        unlinked = self._configuration["mode"] == "client" and not self._zenoh.info.routers_zid()
        return sorted(found | self._liveliness.matching(pattern)), not (late or unlinked)

    def watch(self, pattern: str) -> ZenohTokenWatch:
        watch = ZenohTokenWatch(lambda: self.tokens(pattern))

        def deliver(sample: Any) -> None:
            watch.items.append(sample)
            self._tokens_arrive = True
            self._awake.set()

        handler = Callback(deliver, indirect=False)
        watch.handle = self._zenoh.liveliness().declare_subscriber(pattern, handler, history=True)
        return watch

    def wait(self, subscriber: RawSubscriber) -> None:
        assert isinstance(subscriber, ZenohSubscriber)
        if subscriber.held is not None or self._wake_pending:
            self._wake_pending = False
            return
        self._waiting = subscriber
        subscriber.held = subscriber.subscriber.recv()
        self._waiting = None

    def wake(self) -> None:
        self._awake.set()

    def close(self) -> None:
        if self.open:
            self.open = False
            self._awake.set()
            self._ticker.join()  # a put into a closing session fails, and the thread with it
            if self._peer_links is not None:
                self._peer_links.close(CLOSE_S)
            with suppress(zenoh.ZError):  # the link was closed already
                run_with_timeout(self._close_session, CLOSE_S)
            self._latching.close(CLOSE_S)

    def _count_readers_change(self) -> None:
        # Each number is used once, whichever of Zenoh's threads writes last.
        self.readers_version = next(self._readers_versions)

    def _open(self) -> None:
        self._zenoh = open_session(self._configuration)

    def _close_session(self) -> None:
        self._zenoh.close()  # type: ignore[no-untyped-call]

    def _run_ticker(self) -> None:
        """Wake the loop on request and ten times a second, by a sample that stays in this session."""
        while self.open:
            asked = self._awake.wait(TICKER_S)
            if self._tokens_arrive:
                time.sleep(_TOKENS_S)
                self._tokens_arrive = False
            self._awake.clear()
            self._liveliness.update()
            if self._peer_links is not None:
                self._peer_links.update()
            if (subscriber := self._waiting) is None:
                self._wake_pending = self._wake_pending or asked
            elif self.open:
                here = zenoh.Locality.SESSION_LOCAL
                self._zenoh.put(subscriber.wake_key, b"", encoding=WAKE, allowed_destination=here)


def open_session(configuration: Mapping[str, Any]) -> zenoh.Session:
    """Open a session of Zenoh; raises ZError."""
    with limit_threads(configuration["mode"]):
        return zenoh.open(zenoh.Config.from_json5(json.dumps(configuration)))


def run_with_timeout(work: Callable[[], None], seconds: float | None = None) -> None:
    """Run a blocking call of Zenoh in a thread and wait for it, ``seconds`` at most. So signals are handled meanwhile:
    Zenoh's calls block them until they return. Raises the ZError of ``work``.
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
def limit_threads(mode: str = "peer") -> Iterator[None]:
    """Make Zenoh start with the threads of a mode, unless the environment sets them; children do not inherit this."""
    with _OPENING:
        ours = mode in _THREADS and "ZENOH_RUNTIME" not in os.environ
        if ours:
            os.environ["ZENOH_RUNTIME"] = _THREADS[mode]
        try:
            yield
        finally:
            if ours:
                del os.environ["ZENOH_RUNTIME"]
