"""Open pages: the bounded send queue of each, and the queue of their messages to the loop."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from services.panel.protocol import ClientMessage

MAX_PACKETS = 100
"""Maximum sample packets queued for a slow page, 4 s of them; beyond that, the oldest is dropped."""
MAX_TEXTS = 2000
"""Maximum replies, log lines and values queued for a page; beyond that, the oldest is dropped."""
MAX_PACKET_BYTES = 4 << 20
"""Maximum bytes of queued packets."""

Payload = str | bytes


class Page:
    """The send queue of one page: the newest state of each kind, and texts and packets in order.

    The loop enqueues and flushes, which calls ``wake``; the sender drains; neither waits for the other. ``dropped``
    counts the texts and packets that a slow page missed.
    """

    def __init__(self, number: int, wake: Callable[[], None]) -> None:
        self.number, self._wake = number, wake
        self.dropped = self.rejected = 0
        self.open = True
        self._lock = threading.Lock()
        self._states: dict[str, Payload] = {}
        self._texts: deque[str] = deque()
        self._packets: deque[bytes] = deque()
        self._packet_bytes = 0
        self._pending = False

    def set_state(self, kind: str, payload: Payload) -> None:
        """Queue a state; it replaces a queued one of its kind."""
        with self._lock:
            self._states[kind] = payload
            self._pending = True

    def enqueue(self, payload: Payload) -> None:
        """Queue a text or a packet, each of which arrives as long as the page keeps up."""
        with self._lock:
            if isinstance(payload, str):
                self._texts.append(payload)
                if len(self._texts) > MAX_TEXTS:
                    self._texts.popleft()
                    self.dropped += 1
            else:
                self._packets.append(payload)
                self._packet_bytes += len(payload)
            while len(self._packets) > MAX_PACKETS or self._packet_bytes > MAX_PACKET_BYTES:
                self._packet_bytes -= len(self._packets.popleft())
                self.dropped += 1
            self._pending = True

    def flush(self) -> None:
        """Wake the sender if anything new is queued."""
        with self._lock:
            pending, self._pending = self._pending, False
        if pending and self.open:
            self._wake()

    def drain(self) -> list[Payload]:
        """Remove and return everything queued: the states, then texts and packets, each in order."""
        with self._lock:
            taken = [*self._states.values(), *self._texts, *self._packets]
            self._states, self._texts, self._packets, self._packet_bytes = {}, deque(), deque(), 0
        return taken


def send_reply(page: Page, number: int, ok: bool, text: object) -> None:
    """Send the reply to a page's request ``number``."""
    page.enqueue(msgspec.json.encode({"k": "reply", "id": number, "ok": ok, "result": text}).decode())
    page.flush()


def send_error(page: Page, reason: str) -> None:
    """Send a page the reason why its message was refused."""
    page.enqueue(msgspec.json.encode({"k": "error", "reason": reason[:500]}).decode())
    page.flush()


MAX_QUEUED_MESSAGES = 1024
"""Maximum messages queued for the loop; further ones are refused."""


class Disconnected(NamedTuple):
    """A page has closed, or its connection broke."""


DISCONNECTED = Disconnected()


class PageRegistry:
    """The open pages and their messages. Used by both threads; ``wake`` wakes the loop."""

    def __init__(self, wake: Callable[[], None], max_pages: int) -> None:
        self._wake, self._max_pages = wake, max_pages
        self._lock = threading.Lock()
        self._pages: dict[int, Page] = {}
        self._queue: deque[tuple[Page, ClientMessage | Disconnected]] = deque()
        self._numbers = 0

    @property
    def pages(self) -> list[Page]:
        """The open pages."""
        with self._lock:
            return list(self._pages.values())

    def open_page(self, wake: Callable[[], None]) -> Page | None:
        """Register a new page; returns None if too many are open."""
        with self._lock:
            if len(self._pages) >= self._max_pages:
                return None
            self._numbers += 1
            page = self._pages[self._numbers] = Page(self._numbers, wake)
        return page

    def close_page(self, page: Page) -> None:
        """Remove a page, and queue its disconnection, so that it releases the robots that it drives."""
        page.open = False
        with self._lock:
            self._pages.pop(page.number, None)
            self._queue.append((page, DISCONNECTED))
        self._wake()

    def submit(self, page: Page, message: ClientMessage) -> bool:
        """Queue a message of a page; returns False if the loop is too far behind."""
        with self._lock:
            accepted = len(self._queue) < MAX_QUEUED_MESSAGES
            if accepted:
                self._queue.append((page, message))
        self._wake()
        return accepted

    def reject(self, page: Page) -> None:
        """Count a refused message of a page."""
        page.rejected += 1

    def drain(self) -> list[tuple[Page, ClientMessage | Disconnected]]:
        """Remove and return the messages since the last call."""
        with self._lock:
            messages, self._queue = list(self._queue), deque()
        return messages
