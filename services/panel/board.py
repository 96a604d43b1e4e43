"""Where the server's thread and the loop's meet: pages that come and go, and what they say."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from services.panel.page import Page
from services.panel.words import Said

MOST_SAID = 1024
"""Words that wait for the loop; beyond it they are refused."""


class Gone(NamedTuple):
    """A page has closed, or its connection broke."""


GONE = Gone()


class Board:
    """Used by both threads; ``nudge`` wakes the loop."""

    def __init__(self, nudge: Callable[[], None], most: int) -> None:
        self._nudge, self._most = nudge, most
        self._lock = threading.Lock()
        self._pages: dict[int, Page] = {}
        self._said: deque[tuple[Page, Said | Gone]] = deque()
        self._numbers = 0
        self.refused = 0

    @property
    def pages(self) -> list[Page]:
        """The pages that are open."""
        with self._lock:
            return list(self._pages.values())

    def join(self, wake: Callable[[], None]) -> Page | None:
        """A page opens; None when there are too many."""
        with self._lock:
            if len(self._pages) >= self._most:
                return None
            self._numbers += 1
            page = self._pages[self._numbers] = Page(self._numbers, wake)
        return page

    def leave(self, page: Page) -> None:
        """A page is gone, and lets go of what it drives."""
        page.open = False
        with self._lock:
            self._pages.pop(page.number, None)
            self._said.append((page, GONE))
        self._nudge()

    def say(self, page: Page, said: Said) -> bool:
        """Hand on what a page says; False when the loop is too far behind to take it."""
        with self._lock:
            taken = len(self._said) < MOST_SAID
            if taken:
                self._said.append((page, said))
        self._nudge()
        return taken

    def refuse(self, page: Page) -> None:
        """Count what a page said that was not understood."""
        page.refused += 1
        with self._lock:
            self.refused += 1

    def heard(self) -> list[tuple[Page, Said | Gone]]:
        """What was said since the last call."""
        with self._lock:
            heard, self._said = list(self._said), deque()
        return heard
