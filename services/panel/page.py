"""One open page: what waits to be sent to it, bounded, handed from the loop's thread to the server's."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

MOST_FRAMES = 100
"""Frames of samples that wait for a slow page, 4 s of them; the oldest is dropped for the next."""
MOST_TEXTS = 2000
"""Answers, log lines and values that wait; a page that is this far behind has long been given up."""
MOST_BYTES = 4 << 20
"""Of frames that wait."""

Parcel = str | bytes


class Page:
    """States wait once each, the newest of its kind; texts and frames wait in order. ``wake`` rouses the sender.

    The loop puts and flushes, the sender takes; neither waits for the other. ``dropped`` counts what a slow page
    missed.
    """

    def __init__(self, number: int, wake: Callable[[], None]) -> None:
        self.number, self._wake = number, wake
        self.dropped = self.refused = 0
        self.open = True
        self._lock = threading.Lock()
        self._states: dict[str, Parcel] = {}
        self._texts: deque[str] = deque()
        self._frames: deque[bytes] = deque()
        self._bytes = 0
        self._news = False

    def tell(self, kind: str, parcel: Parcel) -> None:
        """A state: it replaces the one of its kind that still waits."""
        with self._lock:
            self._states[kind] = parcel
            self._news = True

    def stream(self, parcel: Parcel) -> None:
        """Something of which each is to arrive, as long as the page keeps up."""
        with self._lock:
            if isinstance(parcel, str):
                self._texts.append(parcel)
                if len(self._texts) > MOST_TEXTS:
                    self._texts.popleft()
                    self.dropped += 1
            else:
                self._frames.append(parcel)
                self._bytes += len(parcel)
            while len(self._frames) > MOST_FRAMES or self._bytes > MOST_BYTES:
                self._bytes -= len(self._frames.popleft())
                self.dropped += 1
            self._news = True

    def flush(self) -> None:
        """Rouse the sender if there is anything new."""
        with self._lock:
            news, self._news = self._news, False
        if news and self.open:
            self._wake()

    def take(self) -> list[Parcel]:
        """Everything that waits: the states, then texts and frames, each in their order."""
        with self._lock:
            taken = [*self._states.values(), *self._texts, *self._frames]
            self._states, self._texts, self._frames, self._bytes = {}, deque(), deque(), 0
        return taken
