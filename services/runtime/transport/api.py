"""The seam to the network: a few verbs that Zenoh and an in-memory bus implement alike.

A transport belongs to one thread, its owner's loop. The loop blocks in ``wait`` on one inlet and wakes for a sample
there, for a nudge (a query, a signal, another thread) and ten times a second in any case; everything else is drained
without blocking. Waiting on the channel itself, instead of having a receiving thread hand samples over, makes the
round trip a third shorter.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple, Protocol, Self

from messages.requests import MAX_REQUEST_BYTES
from messages.topics import Quality
from services.runtime.transport.request_queue import Refusals

TICKER_S = 0.1
"""``wait`` returns at least this often [s of wall time]."""
ADMIN_SPACE = "@elea"
"""First chunk of the keys that are the runtime's own: those of tokens, and what lockstep and idle loops wait on."""


TIMEOUT = b"Timeout"
"""Payload of the error that stands for an answer which did not come in time; the word is Zenoh's own."""

Sample = tuple[bytes, bytes, Any]
"""One arrival: payload, attachment, and what its inlet tells the rest by, for which most readers never ask."""


class TokenEvent(NamedTuple):
    """A liveliness token appeared (``alive``) or went."""

    key: str
    alive: bool


class RawSubscriber(Protocol):
    """A subscription; the newest samples are kept, the oldest overwritten when nobody takes them."""

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


class RawPublisher(Protocol):
    """A publication."""

    def put(self, payload: bytes, *, attachment: bytes) -> None:
        """Send one sample."""
        ...

    @property
    def has_subscribers(self) -> bool:
        """Whether anybody subscribes at present."""
        ...

    def close(self) -> None:
        """End the publication."""
        ...


class Query(Protocol):
    """A request that waits for its reply; ``key`` is what was asked, wildcards and all."""

    key: str
    payload: bytes

    def reply(self, payload: bytes) -> None:
        """Answer."""
        ...

    def refuse(self, payload: bytes) -> None:
        """Answer with an error."""
        ...


class QueryServer(Protocol):
    """The requests that arrive on one key. Those that are too large, or too many to wait, are refused on arrival."""

    waiting: Collection[object]
    """What waits to be taken."""

    def recv(self) -> Query | None:
        """The oldest request waiting, or None."""
        ...


class Reply(NamedTuple):
    """The answer to a query: ``ok`` tells a result from an error, ``session`` whose it is, empty where nobody's."""

    ok: bool
    payload: bytes
    session: str = ""


class PendingReplies(Protocol):
    """A question that waits for its answers."""

    def poll(self) -> Sequence[Reply] | None:
        """All replies once they are there or the time is up; None before. Empty when nobody was there to ask."""
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
        """Ask anew which tokens are there: one that was missed while links came up is then told of."""
        ...


class Transport(Protocol):
    """A connection to the network, closed by ``with``."""

    session: str
    """The unique id of this connection, as hexadecimal digits."""
    open: bool
    """Whether it was not closed yet."""
    settle_s: float
    """Wall time in which links to the others come up; what is out of sight for longer is not there."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def subscribe(self, key: str, capacity: int, latched: bool = False) -> RawSubscriber:
        """Receive the samples on ``key`` (wildcards allowed); keep ``capacity`` of them."""
        ...

    def advertise(self, key: str, encoding: str, quality: Quality) -> RawPublisher:
        """Send samples on ``key``."""
        ...

    def serve(self, key: str, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> QueryServer:
        """Receive the requests on ``key``, each of at most ``largest`` bytes; ``refusals`` counts what is refused."""
        ...

    def query(self, key: str, payload: bytes, timeout: float) -> Sequence[Reply]:
        """Ask all who serve ``key`` and wait at most ``timeout`` [s]; nobody there is an empty list.

        Each one's answer is in the list; where one stays out, an error TIMEOUT is.
        """
        ...

    def query_async(self, key: str, payload: bytes, timeout: float) -> PendingReplies:
        """As ``query``, without waiting: the caller looks for the replies again and again."""
        ...

    def declare_token(self, key: str) -> Token:
        """Show that this process lives, for as long as the token is kept; ``key`` begins with the chunk KERNEL."""
        ...

    def tokens(self, pattern: str, timeout: float = 1.0) -> list[str]:
        """The tokens that are in sight now; on a fresh connection, those whose links are up."""
        ...

    def watch(self, pattern: str) -> TokenWatch:
        """Follow the tokens that match ``pattern``."""
        ...

    def wait(self, inlet: RawSubscriber) -> None:
        """Block until ``inlet`` has a sample, a nudge comes, or BEAT_S has passed; ``take`` before waiting again."""
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
