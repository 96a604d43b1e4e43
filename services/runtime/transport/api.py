"""The seam to the network: a few verbs that Zenoh and an in-memory bus implement alike.

A transport belongs to one thread, its owner's loop. The loop blocks in ``wait`` on one inlet and wakes for a sample
there, when it is woken (by a query, a signal, another thread) and ten times a second in any case; everything else is
drained without blocking. Waiting on the channel itself, instead of having a receiving thread hand samples over, makes
the round trip a third shorter.
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
"""First chunk of the keys that are the runtime's own: those of tokens, and what lockstep and idle loops wait on."""


TIMEOUT = b"Timeout"
"""Payload of the error that stands for a missing answer at the timeout; the word is Zenoh's own."""

Sample = tuple[bytes, bytes, Any]
"""A received sample: payload, attachment, and the handle for its key and encoding, which most readers never need."""


class TokenEvent(NamedTuple):
    """A liveliness token appeared (``alive``) or went."""

    key: str
    alive: bool


class RawSubscriber(Protocol):
    """A subscription with a ring of the newest samples; unread old ones are overwritten."""

    def recv(self) -> Sample | None:
        """The oldest sample waiting, or None."""
        ...

    def encoding(self, source: Any) -> str:
        """The encoding that the sender of a sample gave, or an empty text."""
        ...

    def key(self, source: Any) -> str:
        """The key on which a sample came."""
        ...

    def close(self) -> None:
        """End the subscription."""
        ...


class ThreadedSubscriber(RawSubscriber, Protocol):
    """A subscription that belongs to a thread of its own."""

    def wait(self) -> bool:
        """Block until a sample waits, or ``wake`` is called; False when the subscription has ended."""
        ...

    def wake(self) -> None:
        """End the wait; from any thread."""
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
    """A query that waits for its reply; ``key`` is the queried key expression, ``attachment`` what its sender put
    beside the payload, or empty.
    """

    key: str
    payload: bytes
    attachment: bytes

    def reply(self, payload: bytes) -> None:
        """Answer."""
        ...

    def refuse(self, payload: bytes) -> None:
        """Answer with an error."""
        ...


class QueryServer(Protocol):
    """The requests that arrive on one key. Those that are too large, or too many to wait, are refused on arrival."""

    waiting: Collection[object]
    """The queries waiting to be answered."""

    def recv(self) -> Query | None:
        """The oldest request waiting, or None."""
        ...

    def close(self) -> None:
        """Receive no more."""
        ...


class Reply(NamedTuple):
    """The answer to a query: ``ok`` for a result, not an error; ``session`` of the server, empty if unknown."""

    ok: bool
    payload: bytes
    session: str = ""


class PendingReplies(Protocol):
    """A question that waits for its answers."""

    def poll(self) -> Sequence[Reply] | None:
        """All replies once they have arrived or time is up, None before; empty without a server."""
        ...

    def received(self) -> Sequence[Reply]:
        """The replies that have come so far, of servers alone."""
        ...


class Token(Protocol):
    """A liveliness token; it goes when it is closed or its process dies."""

    def close(self) -> None:
        """Take the token back."""
        ...


class TokenWatch(Protocol):
    """A view on liveliness tokens; those already there appear first."""

    def poll(self) -> TokenEvent | None:
        """The oldest event waiting, or None."""
        ...

    def refresh(self) -> None:
        """Query the tokens again, to report one that was missed while links came up."""
        ...


class Transport(Protocol):
    """A connection to the network, closed by ``with``."""

    session: str
    """The unique id of this connection, as hexadecimal digits."""
    open: bool
    """Whether it was not closed yet."""
    settle_s: float
    """Wall time [s] in which links come up; what is invisible for longer does not exist."""

    @property
    def readers_version(self) -> int:
        """Another number whenever ``has_subscribers`` of a publication of this connection is another."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def subscribe(
        self, key: str, capacity: int, latched: bool = False, notify: Callable[[], None] | None = None
    ) -> RawSubscriber:
        """Receive the samples on ``key`` (wildcards allowed); keep ``capacity`` of them.

        With ``notify``, which a thread of the network calls at each sample, ``wait`` does not take it.
        """
        ...

    def subscribe_threaded(self, key: str, capacity: int, latched: bool = False) -> ThreadedSubscriber:
        """As ``subscribe``, for a thread that waits for these samples alone."""
        ...

    def advertise(self, key: str, encoding: str, quality: Quality) -> RawPublisher:
        """Send samples on ``key``."""
        ...

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> QueryServer:
        """Receive the queries on ``key``, each of at most ``largest`` bytes; ``refusals`` counts refused ones."""
        ...

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        """Query all servers of ``key`` and wait at most ``timeout`` [s].

        Returns:
            The answer of each server, the error TIMEOUT for a missing one; empty without servers.
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
        """As ``query``, without waiting: the caller looks for the replies again and again.

        ``notify`` is called once all have come, or time is up; by a thread of the network, or by this one.
        """
        ...

    def declare_token(self, key: str) -> Token:
        """Show that this process lives, for as long as the token is kept; ``key`` begins with the chunk KERNEL."""
        ...

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        """The visible tokens, as far as they are known after ``timeout`` [s] of wall time; on a new connection, those
        whose links are up."""
        ...

    def all_tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        """The same; raises TryAgain if the network has not named all of them in time."""
        ...

    def watch(self, pattern: str) -> TokenWatch:
        """Follow the tokens that match ``pattern``."""
        ...

    def wait(self, inlet: RawSubscriber) -> None:
        """Block until ``inlet`` has a sample, ``wake`` is called, or 0.1 s pass; call ``recv`` before the next."""
        ...

    def wake(self) -> None:
        """Wake the loop from another thread or a signal handler."""
        ...

    def close(self) -> None:
        """Leave the network."""
        ...


def idle_subscriber(transport: Transport) -> RawSubscriber:
    """A subscription to nothing, for a loop that waits for nudges alone."""
    return transport.subscribe(f"{ADMIN_SPACE}/{transport.session}/rest", 16)
