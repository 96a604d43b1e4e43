"""Latched topics on Zenoh: a subscriber that comes late fetches the last sample of each publisher.

A publisher keeps its last sample, shows by a token that it does, and answers on the token's key; subscribers watch
these tokens. Keys and samples are those of the advanced publishers and subscribers of ``zenoh.ext``, which may stand on
the other side. Those ask and answer in the thread that receives: when two nodes had 300 KB for each other at once,
their threads waited for each other, none of 60 topics arrived, and Zenoh closed their link for good. Such a subscriber
also holds all samples of its topic back until the last answer has come. Here a thread of its own asks and answers, and
samples count as they come, those that wait to be read in the order of their sending; their numbers tell what is new.
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

from services.runtime.transport.api import TIMEOUT

_KEPT = "@adv/pub"
"""Below a topic's key, where publishers that keep samples have their tokens."""
ASK_S = 10.0
"""Wall time [s] that a publisher has for its answer; then it is asked again, for as long as its token is there."""
AGAIN_S = 0.2, 1.0, 4.0
"""Wall time [s] after which a publisher is asked again from which nothing came at all: it has sent nothing yet, or its
token came before the way to it was known, as while two peers that met through a router are being linked."""
RELEASE_S = 0.2
"""Wall time [s] for which an answered question is kept. Whoever lets go of it last sends the end of the answer. If that
is the thread that receives, because it was still on its way back from handing the question over, then it waits for room
on a link that the answers have filled, and reads nothing meanwhile: where both sides did, nothing arrived for 30 s."""
RECENT = 64
"""Samples by which one that arrives on both ways, sent and fetched, is recognized; of one answer, no more are taken."""

Run = Callable[[Callable[[], None]], None]
"""Has the thread call something."""
RunLater = Callable[[float, Callable[[], None]], None]
"""Has the thread call a function after a delay [s of wall time]."""


class LatchedPublisher:
    """A publication that keeps its last sample. It always has subscribers: those that come later."""

    has_subscribers = True

    def __init__(self, publisher: Any, session: Any, number: int, run: Run, run_later: RunLater) -> None:
        self._publisher, self._session, self._run, self._run_later = publisher, session, run, run_later
        self._last: dict[str, Any] = {}
        key = f"{publisher.key_expr}/{_KEPT}/{session.zid()}/uhlc/{number}"
        self._answers = session.declare_queryable(key, Callback(self._on_query, indirect=False))
        self._token = session.liveliness().declare_token(key)

    def put(self, payload: bytes, *, attachment: bytes) -> None:
        """Keep the sample, then send it: who subscribes in between gets it twice, and nobody misses it."""
        stamp = self._session.new_timestamp()
        self._last = {"payload": payload, "attachment": attachment, "timestamp": stamp}
        self._publisher.put(**self._last)

    def close(self) -> None:
        """End the publication."""
        for each in (self._token, self._answers, self._publisher):
            each.undeclare()

    def _on_query(self, query: Any) -> None:
        """Called by Zenoh in the thread that receives, which must not send."""
        self._run(lambda: self._answer(query))

    def _answer(self, query: Any) -> None:
        if self._last:
            query.reply(self._publisher.key_expr, **self._last, encoding=self._publisher.encoding)
        self._run_later(RELEASE_S, query.drop)


class LatchedPast:
    """The fetched samples of one subscription. A sample may be sent, fetched, or both: then the second is dropped.

    Both copies have one timestamp and one content. The timestamp alone does not do: a program that sends something else
    with the one of a latched sample, which it can ask for as everybody does, would silence it.
    """

    def __init__(self, session: Any, run: Run, run_later: RunLater) -> None:
        self._run, self._run_later, self._session = run, run_later, session
        self.held: Any = None
        """The next of those that were sent, until what was fetched before it has been read."""
        self._waiting: deque[Any] = deque()
        self._sent: deque[Any] = deque(maxlen=RECENT)
        self._fetched: deque[Any] = deque(maxlen=RECENT)
        self._tokens: set[str] = set()
        self._watch: Any = None

    def follow(self, key: str, notify: Callable[[], None]) -> None:
        """Fetch the last sample of each publisher of ``key``, now and whenever one appears; after its subscription.

        ``notify`` is called after each, not in the thread that receives.
        """
        self._notify = notify
        watch = Callback(self._on_token, indirect=False)
        self._watch = self._session.liveliness().declare_subscriber(f"{key}/{_KEPT}/**", watch, history=True)

    def next(self, take: Callable[[], Any | None]) -> Any | None:
        """The next new sample: the older one of what was fetched and what was sent, which ``take`` gives in turn."""
        while self.held is None and (sent := take()) is not None:
            if self._is_new(sent):
                self.held = sent
        if (fetched := self._pop()) is not None:
            return fetched
        sent, self.held = self.held, None
        return sent

    def _pop(self) -> Any | None:
        """The next new fetched sample that is no younger than what is held.

        A token may be reported twice, and its publisher asked twice.
        """
        before = None if self.held is None else self.held.timestamp
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
        """Whether a sample that was sent has not been fetched before."""
        if sample.timestamp is None:
            return True
        self._sent.append(identity := _identity(sample))
        return identity not in self._fetched

    def close(self) -> None:
        """Fetch no more."""
        self._tokens.clear()
        if self._watch is not None:
            self._watch.undeclare()

    def _on_token(self, change: Any) -> None:
        """Called by Zenoh in the thread that receives, which must not send."""
        token = str(change.key_expr)
        if change.kind == zenoh.SampleKind.PUT:
            self._tokens.add(token)
            self._run(lambda: self._ask(token))
        else:
            self._tokens.discard(token)

    def _ask(self, token: str, before: int = 0) -> None:
        """Ask the publisher of a token, from which nothing came ``before`` so many times."""
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
            congestion_control=zenoh.CongestionControl.BLOCK,  # the answer's is the question's
        )


def _identity(sample: Any) -> tuple[Any, int, int]:
    """What the copies of a sample have in common; Python's hashes of bytes have a secret of each process in them."""
    beside = sample.attachment
    return sample.timestamp, hash(sample.payload.to_bytes()), hash(b"" if beside is None else beside.to_bytes())


class Latching:
    """The latched topics of a session; its thread starts with the first."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self._numbers, self._orders = count(), count()
        self._work: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        """What is to be called, by its time; the thread's own."""
        self._thread: threading.Thread | None = None

    def publisher(self, publisher: Any) -> LatchedPublisher:
        """Let a publication keep its last sample."""
        self._start()
        return LatchedPublisher(publisher, self._session, next(self._numbers), self._work.put, self._run_later)

    def past(self) -> LatchedPast:
        """The past of a new subscription."""
        self._start()
        return LatchedPast(self._session, self._work.put, self._run_later)

    def close(self, seconds: float) -> None:
        """End the thread, and wait for that ``seconds`` at most; after the session, so that no question holds it."""
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
        """Wait for what is to be called next; None at the end."""
        try:
            return self._work.get(timeout=max(0.0, self._later[0][0] - monotonic()) if self._later else None)
        except Empty:
            return heappop(self._later)[2]
