"""Waits in ROS time end when their condition holds, after simulation time, and at a reset."""

from __future__ import annotations

import queue
import threading

from services.script.kernel import ScriptKernel
from services.script.waits import wait_for
from tests.harness.memory_kernel import memory_kernel

S = 10**9
PATIENCE_S = 60.0


def outcome(kernel: ScriptKernel, begin_s: int, then_s: int) -> bool:
    """Return the result of a wait of 2 s that starts at one time and then sees another."""
    looked = threading.Event()
    ended: queue.Queue[bool] = queue.Queue()

    def never() -> bool:
        looked.set()
        return False

    kernel.clock.set(begin_s * S)
    kernel.spawn(lambda: ended.put(wait_for(never, 2 * S)), "waits")
    assert looked.wait(PATIENCE_S)
    kernel.clock.set(then_s * S)
    return ended.get(timeout=PATIENCE_S)


def test_a_wait_lasts_in_simulated_time() -> None:
    with memory_kernel(simulated=True) as kernel:
        assert outcome(kernel, 10, 12) is False
        assert outcome(kernel, 20, 1) is False
        assert wait_for(lambda: True, 2 * S)
        assert wait_for(lambda: True)


def test_no_time_passes_before_the_first_clock() -> None:
    with memory_kernel(simulated=True) as kernel:
        first = threading.Event()
        times: list[int] = []

        def at_the_second_look_after_a_clock() -> bool:
            times.append(kernel.now())
            first.set()
            return sum(time > 0 for time in times) > 1

        ended: queue.Queue[bool] = queue.Queue()
        kernel.spawn(lambda: ended.put(wait_for(at_the_second_look_after_a_clock, 2 * S)), "waits")
        assert first.wait(PATIENCE_S)
        kernel.clock.set(57 * S)  # the first known time: the wait starts
        assert ended.get(timeout=PATIENCE_S)


def test_a_wait_by_the_wall_clock_ends() -> None:
    with memory_kernel():
        assert wait_for(lambda: False, S // 100) is False
