"""Latched topics on Zenoh: a late subscriber queries the last sample of each publisher.

A publisher keeps its last sample, declares a token for it, and answers queries on the token's key; subscribers watch
these tokens. Keys and samples are those of the advanced publishers and subscribers of ``zenoh.ext``, so these may be
the other side. They query and answer in the receiving thread: when two nodes had 300 KB for each other at once, their
threads waited for each other, none of 60 topics arrived, and Zenoh closed their link for good. Such a subscriber also
holds back all samples of its topic until the last reply has arrived. Here a thread of its own queries and answers.
Samples are accepted as they arrive, and read in the order of their sending; sequence numbers show which are new.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from heapq import heappop, heappush
from itertools import count
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

import zenoh
from zenoh.handlers import Callback

from services.runtime.transport.api import TIMEOUT, Sample

_KEPT = "@adv/pub"
"""Infix after a topic's key in the tokens of publishers that keep samples."""
ASK_S = 10.0
"""Wall time [s] that a publisher has to reply; then the query is repeated, for as long as its token is there."""
AGAIN_S = 0.2, 1.0, 4.0
"""Wall time [s] after which a publisher without any reply is queried again: it has sent nothing yet, or its token
arrived before the route to it was known, for example while two peers that met through a router are still connecting."""
RELEASE_S = 0.2
"""Wall time [s] for which an answered query is kept. The thread that drops its last reference sends the end of the
reply. If that is the receiving thread, still returning from passing the query on, it waits for space on a link that the
replies have filled and reads nothing meanwhile: when both sides did that, nothing arrived for 30 s."""
RECENT = 64
"""Samples remembered to recognize one that is both sent and fetched; also the maximum accepted from one query."""

Run = Callable[[Callable[[], None]], None]
"""Has the thread call a function."""
RunLater = Callable[[float, Callable[[], None]], None]
"""Has the thread call a function after a delay [s of wall time]."""


class LatchedPublisher:
    """A publication that keeps its last sample. It counts as always having subscribers: later ones need the sample."""

    has_subscribers = True

    def __init__(self, publisher: Any, session: Any, number: int, run: Run, run_later: RunLater) -> None:
        self._publisher, self._session, self._run, self._run_later = publisher, session, run, run_later
        self._key, self._encoding = publisher.key_expr, publisher.encoding
        """Copies for the answering thread: while ``close`` undeclares the publisher, reading them from it fails."""
        self._last: dict[str, Any] = {}
        key = f"{self._key}/{_KEPT}/{session.zid()}/uhlc/{number}"
        self._answers = session.declare_queryable(key, Callback(self._on_query, indirect=False))
        self._token = session.liveliness().declare_token(key)

    def put(self, payload: bytes, *, attachment: bytes) -> None:
        """Keep the sample, then send it: a subscriber that appears in between gets it twice, and none misses it."""
        stamp = self._session.new_timestamp()
        self._last = {"payload": payload, "attachment": attachment, "timestamp": stamp}
        self._publisher.put(**self._last)

    def close(self) -> None:
        """End the publication; queries that are still waiting get no sample."""
        self._last = {}
        for each in (self._token, self._answers, self._publisher):
            each.undeclare()

    def _on_query(self, query: Any) -> None:
        """Pass a query on; called by Zenoh in the receiving thread, which must not send."""
        self._run(lambda: self._answer(query))

    def _answer(self, query: Any) -> None:
        if last := self._last:
            query.reply(self._key, **last, encoding=self._encoding)
        self._run_later(RELEASE_S, query.drop)


class LatchedPast:
    """The fetched samples of one subscription. If a sample is both sent and fetched, the second copy is dropped.

    Both copies have the same timestamp and content. The timestamp alone does not suffice: any program can query a
    latched sample, and could suppress it by sending other content with its timestamp.
    """

    def __init__(self, session: Any, run: Run, run_later: RunLater) -> None:
        self._run, self._run_later, self._session = run, run_later, session
        self.held: Sample | None = None
        """The next sent sample, held until the fetched samples before it have been read."""
        self._waiting: deque[Any] = deque()
        self._sent: deque[Any] = deque(maxlen=RECENT)
        self._fetched: deque[Any] = deque(maxlen=RECENT)
        self._tokens: set[str] = set()
        self._watch: Any = None

    def follow(self, key: str, notify: Callable[[], None]) -> None:
        """Fetch the last sample of each publisher of ``key``, now and whenever one appears; call after subscribing.

        ``notify`` is called after each sample, not in the receiving thread.
        """
        self._notify = notify
        watch = Callback(self._on_token, indirect=False)
        self._watch = self._session.liveliness().declare_subscriber(f"{key}/{_KEPT}/**", watch, history=True)

    def next(self, take: Callable[[], Sample | None]) -> Sample | None:
        """Return the next new sample, the older of the fetched ones and the sent ones, which ``take`` returns."""
        while self.held is None and (sent := take()) is not None:
            if self._is_new(sent[2]):
                self.held = sent
        if (fetched := self._pop()) is not None:
            return unpack_sample(fetched)
        sent, self.held = self.held, None
        return sent

    def _pop(self) -> Any | None:
        """Return the next new fetched sample that is not newer than the held one.

        A token may be reported twice, and its publisher queried twice.
        """
        before = None if self.held is None else self.held[2].timestamp
        while self._waiting:
            stamp = self._waiting[0].timestamp
            if stamp is not None and before is not None and stamp > before:
                return None
            sample = self._waiting.popleft()
            if stamp is None:
                return sample
            identity = _identity(sample)
            if identity not in self._sent and identity not in self._fetched:
                self._fetched.append(identity)
                return sample
        return None

    def _is_new(self, sample: Any) -> bool:
        """Return whether a sent sample has not been fetched before."""
        if sample.timestamp is None:
            return True
        self._sent.append(identity := _identity(sample))
        return identity not in self._fetched

    def close(self) -> None:
        """Stop fetching."""
        self._tokens.clear()
        if self._watch is not None:
            self._watch.undeclare()

    def _on_token(self, change: Any) -> None:
        """Process a publisher's token; called by Zenoh in the receiving thread, which must not send."""
        token = str(change.key_expr)
        if change.kind == zenoh.SampleKind.PUT:
            self._tokens.add(token)
            self._run(lambda: self._ask(token))
        else:
            self._tokens.discard(token)

    def _ask(self, token: str, before: int = 0) -> None:
        """Query the publisher of a token, after ``before`` queries without any reply."""
        if token not in self._tokens:
            return
        late, answered = False, 0

        def on_reply(reply: Any) -> None:
            nonlocal late, answered
            if reply.ok is not None:
                answered += 1
                if answered <= RECENT:
                    self._waiting.append(reply.ok)
                    self._run(self._notify)
            elif reply.err is not None:
                late = late or reply.err.payload.to_bytes() == TIMEOUT

        def on_end() -> None:
            if late:
                self._run(lambda: self._ask(token))
            elif not answered and before < len(AGAIN_S):
                self._run_later(AGAIN_S[before], lambda: self._ask(token, before + 1))

        self._session.get(
            token,
            Callback(on_reply, on_end, indirect=False),
            timeout=ASK_S,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.BLOCK,  # a reply has that of its query
        )


def unpack_sample(sample: Any) -> Sample:
    """Return Zenoh's sample as ours."""
    attachment = sample.attachment
    return sample.payload.to_bytes(), b"" if attachment is None else attachment.to_bytes(), sample


def _identity(sample: Any) -> tuple[Any, int, int]:
    """Return what identifies a sample's copies; Python salts hashes of bytes per process, so they cannot be forged."""
    payload, attachment, _ = unpack_sample(sample)
    return sample.timestamp, hash(payload), hash(attachment)


class Latching:
    """The latched topics of a session; its thread starts with the first topic."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self._numbers, self._orders = count(), count()
        self._work: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        """A heap of delayed calls by their time; used by the thread only."""
        self._thread: threading.Thread | None = None

    def publisher(self, publisher: Any) -> LatchedPublisher:
        """Wrap a publication so that it keeps its last sample."""
        self._start()
        return LatchedPublisher(publisher, self._session, next(self._numbers), self._work.put, self._run_later)

    def past(self) -> LatchedPast:
        """Return the fetched samples for a new subscription."""
        self._start()
        return LatchedPast(self._session, self._work.put, self._run_later)

    def close(self, seconds: float) -> None:
        """End the thread and wait at most ``seconds`` for it; call after closing the session, so that no query
        blocks."""
        self._work.put(None)
        if self._thread is not None:
            self._thread.join(seconds)

    def _start(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._serve, name="latched", daemon=True)
            self._thread.start()

    def _run_later(self, seconds: float, work: Callable[[], None]) -> None:
        due = monotonic() + seconds, next(self._orders), work
        self._work.put(lambda: heappush(self._later, due))

    def _serve(self) -> None:
        while (work := self._next()) is not None:
            with suppress(zenoh.ZError):  # the session has closed
                work()

    def _next(self) -> Callable[[], None] | None:
        """Wait for the next call; returns None at the end."""
        try:
            return self._work.get(timeout=max(0.0, self._later[0][0] - monotonic()) if self._later else None)
        except Empty:
            return heappop(self._later)[2]
