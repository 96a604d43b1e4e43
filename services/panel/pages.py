"""Open pages: the bounded send queue of each, and the queue of what they send to the loop."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from services.panel.protocol import ClientMessage

MAX_PACKETS = 100
"""Frames of samples that wait for a slow page, 4 s of them; the oldest is dropped for the next."""
MAX_TEXTS = 2000
"""Answers, log lines and values that wait; a page that is this far behind has long been given up."""
MAX_PACKET_BYTES = 4 << 20
"""Of frames that wait."""

Payload = str | bytes


class Page:
    """States wait once each, the newest of its kind; texts and frames wait in order. ``wake`` rouses the sender.

    The loop puts and flushes, the sender takes; neither waits for the other. ``dropped`` counts what a slow page
    missed.
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
        """A state: it replaces the one of its kind that still waits."""
        with self._lock:
            self._states[kind] = payload
            self._pending = True

    def enqueue(self, payload: Payload) -> None:
        """Something of which each is to arrive, as long as the page keeps up."""
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
        """Rouse the sender if there is anything new."""
        with self._lock:
            pending, self._pending = self._pending, False
        if pending and self.open:
            self._wake()

    def drain(self) -> list[Payload]:
        """Everything that waits: the states, then texts and frames, each in their order."""
        with self._lock:
            taken = [*self._states.values(), *self._texts, *self._packets]
            self._states, self._texts, self._packets, self._packet_bytes = {}, deque(), deque(), 0
        return taken


def send_reply(page: Page, number: int, ok: bool, text: object) -> None:
    """Answer what a page has asked under ``number``."""
    page.enqueue(msgspec.json.encode({"k": "reply", "id": number, "ok": ok, "result": text}).decode())
    page.flush()


def send_error(page: Page, reason: str) -> None:
    """Tell a page what was wrong with what it said."""
    page.enqueue(msgspec.json.encode({"k": "error", "reason": reason[:500]}).decode())
    page.flush()


MAX_QUEUED_MESSAGES = 1024
"""Words that wait for the loop; beyond it they are refused."""


class Disconnected(NamedTuple):
    """A page has closed, or its connection broke."""


DISCONNECTED = Disconnected()


class PageRegistry:
    """Used by both threads; ``wake`` wakes the loop."""

    def __init__(self, wake: Callable[[], None], most: int) -> None:
        self._wake, self._max_pages = wake, most
        self._lock = threading.Lock()
        self._pages: dict[int, Page] = {}
        self._queue: deque[tuple[Page, ClientMessage | Disconnected]] = deque()
        self._numbers = 0
        self.rejected = 0

    @property
    def pages(self) -> list[Page]:
        """The pages that are open."""
        with self._lock:
            return list(self._pages.values())

    def open_page(self, wake: Callable[[], None]) -> Page | None:
        """A page opens; None when there are too many."""
        with self._lock:
            if len(self._pages) >= self._max_pages:
                return None
            self._numbers += 1
            page = self._pages[self._numbers] = Page(self._numbers, wake)
        return page

    def close_page(self, page: Page) -> None:
        """A page is gone, and lets go of what it drives."""
        page.open = False
        with self._lock:
            self._pages.pop(page.number, None)
            self._queue.append((page, DISCONNECTED))
        self._wake()

    def submit(self, page: Page, message: ClientMessage) -> bool:
        """Queue a message of a page; False when the loop is too far behind."""
        with self._lock:
            taken = len(self._queue) < MAX_QUEUED_MESSAGES
            if taken:
                self._queue.append((page, message))
        self._wake()
        return taken

    def reject(self, page: Page) -> None:
        """Count what a page said that was not understood."""
        page.rejected += 1
        with self._lock:
            self.rejected += 1

    def drain(self) -> list[tuple[Page, ClientMessage | Disconnected]]:
        """What was said since the last call."""
        with self._lock:
            heard, self._queue = list(self._queue), deque()
        return heard
