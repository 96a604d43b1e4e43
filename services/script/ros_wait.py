"""Waits whose length is ROS time: that of the simulation, unless a script runs by the wall clock."""

from __future__ import annotations

from collections.abc import Callable

from services.script.process import kernel

JUMP_NS = 3 * 10**9
"""Time that goes back by more [ns] ends a wait: the simulation was reset."""


def wait_for(ready: Callable[[], bool], duration_ns: int | None = None) -> bool:
    """Wait until ``ready()``, or for a duration of ROS time [ns]; None is for ever.

    Returns:
        Whether it became ready; False also when the process ends. While no clock has come, no time passes.
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
