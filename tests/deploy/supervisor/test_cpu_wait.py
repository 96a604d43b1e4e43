"""The time that a process waited for a processor, from synthetic kernel figures and from real processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from deploy.supervisor import heartbeat_monitor
from deploy.supervisor.heartbeat_monitor import CpuWaitMeter, ThreadTimes, cpu_wait, read_threads
from tests.harness.waiting import wait_until

NS = 1_000_000_000


def thread(ran: float, waited: float, wants: bool) -> ThreadTimes:
    return ThreadTimes(round(ran * NS), round(waited * NS), wants)


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        pytest.param({}, {}, 0.0, id="nothing-known"),
        pytest.param({1: thread(5, 1, False)}, {1: thread(5, 1, False)}, 0.0, id="asleep"),
        pytest.param({1: thread(5, 1, True)}, {1: thread(5.5, 1, True)}, 0.0, id="endless-loop-with-a-processor"),
        pytest.param({1: thread(5, 1, True)}, {1: thread(5, 1, True)}, 0.5, id="waits-since-before"),
        pytest.param({1: thread(5, 1, True)}, {1: thread(5.1, 1.4, True)}, 0.4, id="endless-loop-with-a-share"),
        pytest.param({1: thread(5, 1, False)}, {1: thread(5.1, 1.2, False)}, 0.2, id="waits-that-ended"),
        pytest.param({1: thread(5, 1, False)}, {1: thread(5, 1, True)}, 0.0, id="awake-just-now"),
        pytest.param({1: thread(5, 1, True)}, {1: thread(5.01, 9, False)}, 0.5, id="never-more-than-the-time"),
        pytest.param({1: thread(5, 1, False)}, {2: thread(0, 3, True)}, 0.0, id="another-thread"),
        pytest.param(
            {1: thread(5, 1, False), 2: thread(0, 0, True)},
            {1: thread(5, 1, False), 2: thread(0.2, 0, True)},
            0.3,
            id="the-thread-that-waits-longest",
        ),
    ],
)
def test_held_up(before: dict[int, ThreadTimes], after: dict[int, ThreadTimes], expected: float) -> None:
    assert cpu_wait(before, after, 0.5) == pytest.approx(expected)


def test_the_first_look_knows_nothing_and_later_ones_take_the_worst_process(monkeypatch: pytest.MonkeyPatch) -> None:
    told = {1: {1: thread(0, 0, True)}, 2: {2: thread(0, 0, False)}}
    monkeypatch.setattr(heartbeat_monitor, "read_threads", lambda pid: told[pid])
    look = CpuWaitMeter()
    look.reset(1, 2)
    assert look.measure(10.0) == 0.0
    told = {1: {1: thread(0.4, 0, True)}, 2: {2: thread(0, 0.3, False)}}
    assert look.measure(10.5) == pytest.approx(0.3)
    look.reset(2)
    assert look.measure(11.0) == 0.0
    told = {2: {2: thread(0, 0.5, False)}}
    assert look.measure(11.5) == pytest.approx(0.2), "of the processes named last"
    look.reset()
    assert [look.measure(each) for each in (12.0, 13.0)] == [0.0, 0.0]


def test_the_kernel_tells_of_every_thread() -> None:
    rest = threading.Event()
    sleeper = threading.Thread(target=rest.wait)
    sleeper.start()
    try:
        wait_until(lambda: not read_threads(os.getpid())[sleeper.native_id or 0].runnable)
        mine = read_threads(os.getpid())[threading.get_native_id()]
        assert mine.ran > 0
        assert not mine.runnable, "who looks does not look while it waits"
    finally:
        rest.set()
        sleeper.join()


def test_where_nothing_is_told_nothing_is_excused() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    look = CpuWaitMeter()
    look.reset(gone.pid)
    assert read_threads(gone.pid) == {}
    assert [look.measure(each) for each in (1.0, 2.0)] == [0.0, 0.0]


def test_a_process_that_is_stopped_is_not_held_up() -> None:
    """It wouldn't run even if it got a processor."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as spins:
        try:
            wait_until(lambda: read_threads(spins.pid) and read_threads(spins.pid)[spins.pid].ran > 0.05 * NS)
            spins.send_signal(signal.SIGSTOP)
            wait_until(lambda: not read_threads(spins.pid)[spins.pid].runnable)
            look, start = CpuWaitMeter(), time.monotonic()
            look.reset(spins.pid)
            look.measure(start)
            time.sleep(0.3)
            assert look.measure(time.monotonic()) == 0.0
        finally:
            spins.kill()
