"""The interface to the network, implemented by Zenoh and by an in-memory bus.

A transport belongs to one thread, its owner's loop. The loop blocks in ``wait`` on one subscriber and wakes for its
samples, when it is woken (by a query, a signal, another thread) and ten times a second in any case; everything else is
drained without blocking. Waiting on the channel itself, instead of having a receiving thread pass samples on, makes the
round trip a third shorter.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple, Protocol, Self

from messages.requests import MAX_REQUEST_BYTES
from messages.topics import Quality
from services.runtime.transport.request_queue import Refusals

TICKER_S = 0.1
"""``wait`` returns at least this often [s of wall time]."""
ADMIN_SPACE = "@elea"
"""First chunk of the runtime's own keys: tokens, pings, lockstep's messages and the wake-ups of idle loops."""


TIMEOUT = b"Timeout"
"""Payload of the error reply for a missing answer at the timeout; Zenoh's own word."""

Sample = tuple[bytes, bytes, Any]
"""A received sample: payload, attachment, and the handle for its key and encoding, which most readers never need."""


class TokenEvent(NamedTuple):
    """A liveliness token that appeared (``alive``) or disappeared."""

    key: str
    alive: bool


class RawSubscriber(Protocol):
    """A subscription with a ring of the newest samples; unread old ones are overwritten."""

    def recv(self) -> Sample | None:
        """Return the oldest waiting sample, or None."""
        ...

    def encoding(self, source: Any) -> str:
        """Return the encoding that the sender of a sample gave, or an empty text."""
        ...

    def key(self, source: Any) -> str:
        """Return the key on which a sample arrived."""
        ...

    def close(self) -> None:
        """End the subscription."""
        ...


class ThreadedSubscriber(RawSubscriber, Protocol):
    """A subscription that belongs to a thread of its own."""

    def wait(self) -> bool:
        """Block until a sample is waiting or ``wake`` is called; returns False if the subscription has ended."""
        ...

    def wake(self) -> None:
        """End the wait; may be called from any thread."""
        ...


class RawPublisher(Protocol):
    """A publication."""

    def put(self, payload: bytes, *, attachment: bytes) -> None:
        """Send one sample."""
        ...

    @property
    def has_subscribers(self) -> bool:
        """Whether the key has subscribers."""
        ...

    def close(self) -> None:
        """End the publication."""
        ...


class Query(Protocol):
    """A query waiting for its reply; ``key`` is the queried key expression, ``attachment`` may be empty."""

    key: str
    payload: bytes
    attachment: bytes

    def reply(self, payload: bytes) -> None:
        """Send the reply."""
        ...

    def refuse(self, payload: bytes) -> None:
        """Send an error reply."""
        ...


class QueryServer(Protocol):
    """The queue of requests on one key. Requests that are too large, or do not fit, are refused on arrival."""

    waiting: Collection[object]
    """The queries waiting to be answered."""

    def recv(self) -> Query | None:
        """Return the oldest waiting request, or None."""
        ...

    def close(self) -> None:
        """Stop receiving requests."""
        ...


class Reply(NamedTuple):
    """The reply to a query: ``ok`` for a result, false for an error; ``session`` of the server, empty if unknown."""

    ok: bool
    payload: bytes
    session: str = ""


class PendingReplies(Protocol):
    """A query whose replies are pending."""

    def poll(self) -> Sequence[Reply] | None:
        """Return all replies once they have arrived or the timeout has passed, else None; empty without a server."""
        ...

    def received(self) -> Sequence[Reply]:
        """Return the replies received from servers so far, without timeouts."""
        ...


class Token(Protocol):
    """A liveliness token; it disappears when it is closed or its process dies."""

    def close(self) -> None:
        """Withdraw the token."""
        ...


class TokenWatch(Protocol):
    """The events of liveliness tokens; those of existing tokens come first."""

    def poll(self) -> TokenEvent | None:
        """Return the oldest waiting event, or None."""
        ...

    def refresh(self) -> None:
        """Query the tokens again, to report those missed while links came up."""
        ...


class Transport(Protocol):
    """A connection to the network, closed by ``with``."""

    session: str
    """The unique id of this connection, as hexadecimal digits."""
    open: bool
    """Whether it has not been closed yet."""
    settle_s: float
    """Wall time [s] in which links come up; a node that is invisible for longer does not exist."""

    @property
    def readers_version(self) -> int:
        """A number that changes whenever ``has_subscribers`` of one of this connection's publications changes."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def subscribe(
        self, key: str, capacity: int, latched: bool = False, notify: Callable[[], None] | None = None
    ) -> RawSubscriber:
        """Subscribe to ``key`` (wildcards allowed), with a ring of ``capacity`` samples.

        A thread of the network calls ``notify`` at each sample; such a subscription cannot be passed to ``wait``.
        """
        ...

    def subscribe_threaded(self, key: str, capacity: int, latched: bool = False) -> ThreadedSubscriber:
        """Like ``subscribe``, for a thread that waits only for these samples."""
        ...

    def advertise(self, key: str, encoding: str, quality: Quality) -> RawPublisher:
        """Declare a publication on ``key``."""
        ...

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> QueryServer:
        """Serve the queries on ``key``, of at most ``largest`` bytes each; ``refusals`` counts refused ones."""
        ...

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        """Query all servers of ``key`` and wait at most ``timeout`` [s].

        Returns:
            The reply of each server, and one error TIMEOUT if any is missing; empty without servers.
        """
        ...

    def query_async(
        self,
        key: str,
        payload: bytes,
        timeout: float,
        attachment: bytes = b"",
        notify: Callable[[], None] | None = None,
    ) -> PendingReplies:
        """Like ``query``, without waiting: the caller polls for the replies.

        ``notify`` is called when replies have arrived or the timeout has passed, by any thread.
        """
        ...

    def declare_token(self, key: str) -> Token:
        """Declare a liveliness token, visible until it is closed or this process dies.

        The first chunk of ``key`` is ADMIN_SPACE.
        """
        ...

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        """Return the visible tokens known within ``timeout`` [s] of wall time; on a new connection, only those whose
        links are up."""
        ...

    def all_tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        """Like ``tokens``; raises TryAgain if the network does not report all of them in time."""
        ...

    def arrived_tokens(self, pattern: str) -> set[str]:
        """Return the tokens that match ``pattern`` and whose declarations have arrived here, and with them all that
        their sessions declared before: what is sent from now on reaches these subscriptions.
        """
        ...

    def watch(self, pattern: str) -> TokenWatch:
        """Watch the tokens that match ``pattern``."""
        ...

    def wait(self, subscriber: RawSubscriber) -> None:
        """Block until ``subscriber`` has a sample, ``wake`` is called, or 0.1 s pass; call ``recv`` before the next."""
        ...

    def wake(self) -> None:
        """Wake the loop from another thread or a signal handler."""
        ...

    def close(self) -> None:
        """Leave the network."""
        ...


def idle_subscriber(transport: Transport) -> RawSubscriber:
    """Return a subscription without samples, for a loop that waits only for wake-ups."""
    return transport.subscribe(f"{ADMIN_SPACE}/{transport.session}/rest", 16)
