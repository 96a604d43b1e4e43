"""Waits until a condition holds in another process or thread, never for a fixed time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

PATIENCE = 3.0
"""Factor of all limits, for machines that are slow, busy or both: a limit ends what hangs, and measures nothing."""


def wait_until(probe: Callable[[], T], within: float = 10.0, what: str = "", every: float = 0.005) -> T:
    """Poll ``probe`` each ``every`` [s] and return its first true value; fail after PATIENCE times ``within`` [s]."""
    within *= PATIENCE
    deadline = time.monotonic() + within
    while not (value := probe()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {within:g} s: {what or probe}")
        time.sleep(every)
    return value
