"""The queue of requests at a server, bounded in number and bytes, and the count of those refused."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

from messages.base import encode, saturating_add
from messages.requests import MAX_REQUEST_BYTES, Refusal

MAX_WAITING = 1024
"""Maximum requests waiting at one server: three times the number that a simulation of 300 robots sends at once."""
MAX_BYTES = 4 << 20
"""Maximum bytes of all requests waiting at one server."""
MAX_REASON_LENGTH = 1 << 14
"""Maximum characters of a reason, which is sent and displayed."""

T = TypeVar("T")


class Refusals:
    """The requests of a node answered with an error: their count, and the reason of the last one."""

    def __init__(self) -> None:
        self.count, self.reason = 0, ""
        self._lock = threading.Lock()

    def add(self, reason: str) -> bytes:
        """Count a refusal, and return its error reply."""
        sound = reason[:MAX_REASON_LENGTH].encode(errors="replace").decode()
        with self._lock:
            self.count = saturating_add(self.count, 1)
            self.reason = sound
        return encode(Refusal(reason=sound))


class RequestQueue(Generic[T]):
    """A queue between the receiving thread and the answering loop.

    A request that is too large, or finds the queue full, is refused: ``offer`` returns the error reply to send.

    Args:
        largest: Maximum bytes of one request, including its attachment.
        refusals: Counts the refused requests.
    """

    def __init__(self, largest: int = MAX_REQUEST_BYTES, refusals: Refusals | None = None) -> None:
        self.items: deque[tuple[T, int]] = deque()
        self._refusals = refusals or Refusals()
        self._largest, self._bytes = largest, 0
        self._lock = threading.Lock()

    def offer(self, item: T, size: int) -> bytes | None:
        """Queue a request of ``size`` bytes; returns None, or the error reply if it is refused."""
        if size > self._largest:
            return self._refusals.add(f"a request of {size} bytes, the limit is {self._largest}")
        with self._lock:
            if len(self.items) < MAX_WAITING and self._bytes + size <= MAX_BYTES:
                self.items.append((item, size))
                self._bytes += size
                return None
        return self._refusals.add(
            f"busy: {len(self.items)} requests wait already; the limits are {MAX_WAITING} requests and "
            f"{MAX_BYTES >> 20} MiB: retry later, and check whether a program calls in an endless loop"
        )

    def pop(self) -> T | None:
        """Return the oldest request, or None."""
        if not self.items:
            return None
        with self._lock:
            item, size = self.items.popleft()
            self._bytes -= size
            return item
