"""Waits of client libraries: for ROS time to pass, and until the network is known."""

from __future__ import annotations

import time
from collections.abc import Callable

from services.script.api import kernel

JUMP_NS = 3 * 10**9
"""A backward jump of time by more than this [ns] ends a wait: the simulation was reset."""


QUIET_S, LONGEST_S = 0.25, 3.0
"""Wall time without changes after which the network counts as known, and the maximum wait for that."""


def wait_for(ready: Callable[[], bool], duration_ns: int | None = None) -> bool:
    """Wait until ``ready()``, or for a duration of ROS time [ns]; None waits for ever.

    ROS time is simulation time unless the script runs by the wall clock; before the first clock, no time passes.

    Returns:
        Whether it became ready; False also when the process ends.
    """
    node = kernel()
    if duration_ns is None:
        return node.wait_until(ready)
    if node.lockstep or not node.simulated:
        return node.wait_until(ready, duration_ns / 1e9)
    began = node.now()

    def over() -> bool:
        nonlocal began
        now = node.now()
        began = began or now
        return now >= began + duration_ns or now < began - JUMP_NS

    node.wait_until(lambda: ready() or over())
    return ready()


def settle() -> None:
    """Wait until no further publication, subscription or service appears."""
    running, deadline = kernel(), time.monotonic() + LONGEST_S
    known, since = -1, time.monotonic()
    while (now := time.monotonic()) < deadline and not (known > 0 and now - since > QUIET_S):
        count = len(running.graph())
        if count != known:
            known, since = count, now
        time.sleep(0.02)
