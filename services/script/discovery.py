"""Waits until what runs on the network is known: a command asks at once, and the answers come one by one."""

from __future__ import annotations

import time

from services.script.process import kernel

QUIET_S = 0.25
LONGEST_S = 3.0


def settle() -> None:
    """Wait until no further publication, subscription or service becomes known."""
    running, deadline = kernel(), time.monotonic() + LONGEST_S
    known, since = -1, time.monotonic()
    while (now := time.monotonic()) < deadline and not (known > 0 and now - since > QUIET_S):
        count = len(running.graph())
        if count != known:
            known, since = count, now
        time.sleep(0.02)
