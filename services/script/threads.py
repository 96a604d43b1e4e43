"""The threads of a script and their waits, behind one Protocol; here in real time."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any, Protocol

from services.runtime.transport.api import ThreadedSubscriber
from services.script.api import ScriptStopped, TimeMovedBackwards
from services.script.budget import PUBLISH
from services.script.clock import ScriptClock

LOOKS = 200
"""Points (checks of time or state) that a thread may spend in real time before it is slowed down, unless it waits."""
SHARE = 0.36
"""Share of a core that a loop without waits gets in real time, so that physics and the other nodes have enough."""
MOST_PUBLISHED = 2000.0
"""Maximum rate [Hz] at which a loop without waits publishes in real time: above that of any robot's loop, and one at
which a busy subscriber loses nothing.
"""
_MIN_PAUSE_S, _MAX_PAUSE_S = 0.0005, 0.02
_LONGEST_WAIT_S = 0.1
"""Wall time [s] after which a sleeping thread checks the time again without a notification."""


class Worker(Protocol):
    """A thread that does the work of one topic, service or timer when it is due."""

    def notify(self) -> None:
        """Notify the thread that there may be work; from any thread."""
        ...

    def follow(self, samples: ThreadedSubscriber) -> None:
        """Also work whenever samples arrive."""
        ...

    def close(self) -> None:
        """End the thread once its current work is done."""
        ...


class Threads(Protocol):
    """The threads of a script, with their sleeps and waits."""

    def sleep_until(self, time_ns: int) -> None:
        """As ``Kernel.sleep_until``."""
        ...

    def wait_until(self, ready: Callable[[], bool], timeout: float | None, by_messages: bool = False) -> bool:
        """As ``Kernel.wait_until``."""
        ...

    def wake(self) -> None:
        """As ``Kernel.wake``."""
        ...

    def point(self, cost: float) -> None:
        """As ``Kernel.point``."""
        ...

    def rest(self, seconds: float) -> None:
        """Sleep in wall time."""
        ...

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        """As ``Kernel.spawn``."""
        ...

    def lock(self) -> Any:
        """As ``Kernel.lock``."""
        ...

    def worker(self, name: str, work: Callable[[], bool]) -> Worker:
        """Return a thread that calls ``work`` after each notify until it returns False, when nothing is left to do."""
        ...

    def stop(self) -> None:
        """End all waits: the process was asked to end, and its hooks have run."""
        ...


def thread_body(target: Callable[[], None], name: str) -> Callable[[], None]:
    """Return ``target`` as the body of a script's thread: an exception is reported and ends only this thread."""

    def run() -> None:
        try:
            target()
        except ScriptStopped:
            pass
        except Exception:  # noqa: BLE001 - whatever the script raises ends this thread alone
            report_exception(f"thread {name}")

    return run


def report_exception(where: str) -> None:
    """Print the traceback of the exception being handled, which ends only its thread or callback."""
    sys.stderr.write(f"exception in {where}:\n{traceback.format_exc()}")


class FreeThreads:
    """Threads that run concurrently, as in ROS. Loops that never wait are slowed down."""

    def __init__(self, clock: ScriptClock) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._generation = 0
        self._stopped = False
        self._spent = _Spent()
        clock.on_change = self.wake

    def sleep_until(self, time_ns: int) -> None:
        clock, epoch = self._clock, self._clock.epoch
        self._spent.points, self._spent.published = 0.0, 0
        while (now := clock.now()) < time_ns or not clock.started:
            if self._stopped:
                if clock.simulated:
                    raise ScriptStopped("the process was asked to end")
                return
            with self._changed:
                self._changed.wait(min(clock.wall_until(time_ns, now), _LONGEST_WAIT_S))
            if clock.epoch != epoch:
                raise TimeMovedBackwards("simulation time was reset")
        self._spent.began = time.thread_time()

    def wait_until(self, ready: Callable[[], bool], timeout: float | None, by_messages: bool = False) -> bool:
        deadline = None if timeout is None else time.monotonic() + timeout
        self._spent.points, self._spent.published = 0.0, 0
        while True:
            seen = self._generation
            if ready():
                return True
            left = _LONGEST_WAIT_S if deadline is None else deadline - time.monotonic()
            if self._stopped or left <= 0:
                return False
            with self._changed:
                if self._generation == seen:
                    self._changed.wait(min(left, _LONGEST_WAIT_S))

    def wake(self) -> None:
        with self._changed:
            self._generation += 1
            self._changed.notify_all()

    def point(self, cost: float) -> None:
        spent = self._spent
        spent.points += cost
        spent.published += cost == PUBLISH
        if spent.points < LOOKS:
            return
        now = time.thread_time()
        pause = max((now - spent.began) * (1.0 / SHARE - 1.0), spent.published / MOST_PUBLISHED)
        spent.points, spent.published = 0.0, 0
        time.sleep(min(max(pause, _MIN_PAUSE_S), _MAX_PAUSE_S))
        spent.began = now

    def rest(self, seconds: float) -> None:
        time.sleep(seconds)
        self._spent.points, self._spent.published, self._spent.began = 0.0, 0, time.thread_time()

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        thread = threading.Thread(target=thread_body(target, name), name=name, daemon=True)
        thread.start()
        return thread

    def lock(self) -> Any:
        return threading.RLock()

    def worker(self, name: str, work: Callable[[], bool]) -> Worker:
        made = FreeWorker(name, work)
        made.start()
        return made

    def stop(self) -> None:
        self._stopped = True
        self.wake()


class FreeWorker:
    """A thread that sleeps between notifications."""

    def __init__(self, name: str, work: Callable[[], bool]) -> None:
        self._notified = threading.Event()
        self._samples: ThreadedSubscriber | None = None
        self._open = True
        self._work = work
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def notify(self) -> None:
        self._notified.set()
        if (samples := self._samples) is not None:
            samples.wake()

    def follow(self, samples: ThreadedSubscriber) -> None:
        self._samples = samples
        self._notified.set()

    def close(self) -> None:
        self._open = False
        self.notify()

    def _run(self) -> None:
        while self._open and self._wait():
            self._notified.clear()
            while self._open and self._work():
                pass

    def _wait(self) -> bool:
        """Wait for a notify or a sample; return False when no more samples will arrive."""
        if self._notified.is_set():
            return True
        return self._samples.wait() if self._samples is not None else self._notified.wait()


class _Spent(threading.local):
    """What a thread has spent since its last wait: points, messages, and its processor time [s] at that moment."""

    points = 0.0
    published = 0
    began = 0.0
