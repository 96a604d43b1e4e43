"""The transport on Eclipse Zenoh."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Self

import zenoh
from zenoh.handlers import Callback, FifoChannel, RingChannel

from messages.requests import LARGEST_REQUEST
from messages.topics import Quality
from services.runtime.errors import TryAgain
from services.runtime.network import sockets
from services.runtime.network.backlog import Backlog, Refusals
from services.runtime.network.transport import BEAT_S, KERNEL, Inlet, Reply
from services.runtime.network.zenoh_ends import (
    NUDGE,
    ZenohCensus,
    ZenohInlet,
    ZenohOutlet,
    ZenohPending,
    ZenohServer,
    ZenohToken,
    ZenohWatch,
    answers,
)

# One thread receives (by default one wakes another for each message), another sends while that one waits for room. A
# router keeps to the defaults: it has to pass on what it receives, and lost large messages under load with one thread.
_THREADS = "(rx: (worker_threads: 1), acc: (handover: rx), net: (handover: rx))"

_OPENING = threading.Lock()
"""Held while a session opens: the environment belongs to all threads."""

CLOSE_S = 1.5
"""Wall time that leaving the network takes at most. On a link that answers nothing, Zenoh takes 10 s: its sockets wait
so long (SO_LINGER) for the other side to acknowledge what was sent. A process that ends does not wait, and whoever
listens sees its tokens go all the same."""

_MOST_TOKENS = 1 << 20
"""Answers that a question for tokens can hold; a fleet of twelve processes has 400."""

_EVERYBODY: dict[str, Any] = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
"""Zenoh asks all who serve a key in any case; by default it passes on one of their answers and hides the others."""

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
        self._waiting: ZenohInlet | None = None
        self._poked = False
        self._awake = threading.Event()
        self.open = True

    def __enter__(self) -> Self:
        zenoh.init_log_from_env_or("off")
        wanted, listens = (self._configuration[each]["endpoints"] for each in ("connect", "listen"))
        for each in {sockets.path_of(each).parent for each in (*wanted, *listens) if sockets.is_unix(each)}:
            sockets.secure(each)
        try:
            apart(self._open)
        except zenoh.ZError as error:
            raise TryAgain(f"cannot join the network (connect {wanted}, listen {listens}): {error}") from None
        self.session = str(self._zenoh.zid())
        self._census = ZenohCensus()
        if self._configuration["mode"] != "client":  # the router answers a client, and whole
            hear = Callback(self._census.hear, indirect=False)
            self._census.handle = self._zenoh.liveliness().declare_subscriber(f"{KERNEL}/**", hear, history=True)
        self._ticker = threading.Thread(target=self._beat, name="nudge", daemon=True)
        self._ticker.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def subscribe(self, key: str, capacity: int, latched: bool = False) -> ZenohInlet:
        handler: Any = RingChannel(capacity)
        if latched:
            past = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            subscriber: Any = zenoh.ext.declare_advanced_subscriber(self._zenoh, key, handler, history=past)
        else:
            subscriber = self._zenoh.declare_subscriber(key, handler)
        return ZenohInlet(key, subscriber, self.session)

    def publish(self, key: str, encoding: str, quality: Quality) -> ZenohOutlet:
        options = dict(_QUALITIES[quality], encoding=zenoh.Encoding(encoding))
        if quality is Quality.LATCHED:
            cache = zenoh.ext.CacheConfig(1)
            publisher = zenoh.ext.declare_advanced_publisher(
                self._zenoh, key, cache=cache, publisher_detection=True, **options
            )
            return ZenohOutlet(publisher, latched=True)
        return ZenohOutlet(self._zenoh.declare_publisher(key, **options))

    def serve(self, key: str, largest: int = LARGEST_REQUEST, refusals: Refusals | None = None) -> ZenohServer:
        server = ZenohServer(Backlog(largest, refusals), self._awake.set)
        server.handle = self._zenoh.declare_queryable(key, Callback(server.hear, indirect=False))
        return server

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        replies = self._zenoh.get(key, payload=payload, timeout=timeout, **_EVERYBODY)
        return [each for reply in replies for each in answers(reply)]

    def ask(self, key: str, payload: bytes, timeout: float) -> ZenohPending:
        return ZenohPending(self._zenoh.get(key, payload=payload, timeout=timeout, **_EVERYBODY))

    def token(self, key: str) -> ZenohToken:
        return ZenohToken(self._zenoh.liveliness().declare_token(key))

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        # With Zenoh's own FIFO, 256 deep, a get that more tokens answer than fit never returns.
        replies = self._zenoh.liveliness().get(pattern, FifoChannel(_MOST_TOKENS), timeout=timeout)
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        return sorted(found | self._census.matching(pattern))

    def watch(self, pattern: str) -> ZenohWatch:
        watch = ZenohWatch(lambda: self.tokens(pattern))

        def hand_over(sample: Any) -> None:
            watch.items.append(sample)
            self._awake.set()

        handler = Callback(hand_over, indirect=False)
        watch.handle = self._zenoh.liveliness().declare_subscriber(pattern, handler, history=True)
        return watch

    def wait(self, inlet: Inlet) -> None:
        assert isinstance(inlet, ZenohInlet)
        if inlet.held is not None or self._poked:
            self._poked = False
            return
        self._waiting = inlet
        inlet.held = inlet.subscriber.recv()
        self._waiting = None

    def nudge(self) -> None:
        self._awake.set()

    def close(self) -> None:
        if self.open:
            self.open = False
            self._awake.set()
            self._ticker.join()  # a nudge into a session that closes fails, and the thread with it
            with suppress(zenoh.ZError):  # the link was gone already
                apart(self._leave, CLOSE_S)

    def _open(self) -> None:
        with few_threads(self._configuration["mode"] != "router"):
            self._zenoh = zenoh.open(zenoh.Config.from_json5(json.dumps(self._configuration)))

    def _leave(self) -> None:
        self._zenoh.close()  # type: ignore[no-untyped-call]

    def _beat(self) -> None:
        """Wake the loop when asked and ten times a second, by a sample that stays in this session."""
        while self.open:
            asked = self._awake.wait(BEAT_S)
            self._awake.clear()
            if (inlet := self._waiting) is None:
                self._poked = self._poked or asked
            elif self.open:
                here = zenoh.Locality.SESSION_LOCAL
                self._zenoh.put(inlet.nudge_key, b"", encoding=NUDGE, allowed_destination=here)


def apart(work: Callable[[], None], seconds: float | None = None) -> None:
    """Run what may block within Zenoh in a thread of its own and wait for it, ``seconds`` at most. So a signal is heard
    meanwhile: a call of Zenoh's lets none through until it returns. Raises the ZError of ``work``.
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
def few_threads(wanted: bool = True) -> Iterator[None]:
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
