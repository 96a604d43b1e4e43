"""Waits until a condition holds in another process or thread, never for a fixed time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def wait_until(probe: Callable[[], T], within: float = 30.0, what: str = "", every: float = 0.005) -> T:
    """Poll ``probe`` each ``every`` [s] and return its first true value; fail after ``within`` [s]."""
    deadline = time.monotonic() + within
    while not (value := probe()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {within} s: {what or probe}")
        time.sleep(every)
    return value
