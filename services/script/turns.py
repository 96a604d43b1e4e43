"""Threads that take turns in lockstep: one runs at a time, so that a script repeats bit for bit.

A thread ends its turn in a wait, or when its budget of points for the tick is spent. Who runs at a tick follows from
counts and the order of creation: first the workers that have messages, requests or timers due, in the order of their
creation; then the sleepers by (deadline, order); then those whose condition became true. This is repeated while a turn
made something ready within the tick, each thread at most once per pass.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from typing import Any, Literal

from services.runtime.process import ROOT
from services.runtime.transport.api import ThreadedSubscriber
from services.script.api import ScriptStopped, TimeMovedBackwards
from services.script.budget import BUDGET
from services.script.clock import ScriptClock
from services.script.threads import FreeThreads, Worker, thread_body

LOOK_S = 0.2
"""Wall time [s] after which the node is served while a turn lasts."""
NEVER_NS = 1 << 62
SLOW_S = 10.0
"""Wall time [s] after which a turn that does not end is logged, with its location."""

_LOOKS = 20

Kind = Literal["start", "idle", "sleep", "condition", "budget", "returned", "over"]


@dataclass(eq=False)
class _Wait:
    """What a thread waits for; ``until`` is a simulation time [ns]."""

    kind: Kind
    number: int
    until: int | None = None
    epoch: int = 0
    ready: Callable[[], bool] | None = None
    by_messages: bool = False
    outcome: bool = False


@dataclass(eq=False)
class _Thread:
    """A thread that takes turns; only the last of ``waits`` counts, since a signal handler may nest another."""

    name: str
    order: int
    go: Any = field(default_factory=threading.Lock)
    ident: int | None = None
    points: float = 0.0
    notified: bool = False
    waits: list[_Wait] = field(default_factory=list)
    passed: int = -1
    ended: bool = False

    def __post_init__(self) -> None:
        self.go.acquire()


class TurnThreads:
    """Threads of which one runs at a time. Created by the main thread, which has the first turn.

    ``run`` and ``wait_for_turn`` belong to the node's thread. Threads started by other means run freely.
    """

    def __init__(self, clock: ScriptClock, warn: Callable[[str], None]) -> None:
        self._clock, self._warn = clock, warn
        self._free = FreeThreads(clock)
        clock.on_change = _nothing
        self._local = threading.local()
        self._numbers = count()
        self._threads: list[_Thread] = []
        self._returned = threading.Lock()
        self._returned.acquire()
        self._stopped = self._unknown_thread_noted = False
        self._passes = 0
        self.main = self._add("main")
        self.main.ident = threading.get_ident()
        self._local.thread = self.main
        self._holder: _Thread | None = self.main

    def sleep_until(self, time_ns: int) -> None:
        if (me := self._me()) is None:
            self._note_unknown_thread()
            return self._free.sleep_until(time_ns)
        clock, epoch = self._clock, self._clock.epoch
        if clock.started and clock.now() >= time_ns:
            return self.point(1.0)
        if self._stopped:
            raise ScriptStopped("the process was asked to end")
        self._park(me, _Wait("sleep", next(self._numbers), time_ns, epoch))
        if clock.epoch != epoch:
            raise TimeMovedBackwards("simulation time was reset")
        if self._stopped and clock.now() < time_ns:
            raise ScriptStopped("the process was asked to end")
        return None

    def wait_until(self, ready: Callable[[], bool], timeout: float | None, by_messages: bool = False) -> bool:
        if (me := self._me()) is None:
            if self._is_node():
                raise RuntimeError("a condition that is waited for may not wait itself")
            self._note_unknown_thread()
            return self._free.wait_until(ready, timeout)
        self.point(1.0)
        if ready():
            return True
        if self._stopped or (timeout is not None and timeout <= 0):
            return False
        until = None if timeout is None else self._clock.now() + round(timeout * 1e9)
        wait = _Wait("condition", next(self._numbers), until, self._clock.epoch, ready, by_messages)
        self._park(me, wait)
        return wait.outcome or ready()

    def wake(self) -> None:
        self._free.wake()

    def point(self, cost: float) -> None:
        if (me := self._me()) is None:
            return None if self._is_node() else self._free.point(cost)
        me.points += cost
        if self.main.ended and self._stopped:  # as in Python, a thread that computes for ever ends with the process
            self._park(me, _Wait("over", next(self._numbers)))
        elif me.points >= BUDGET:
            self._park(me, _Wait("budget", next(self._numbers)))
        return None

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        thread = _Spawned(self, thread_body(target, name), name)
        thread.start()
        return thread

    def enroll(self, name: str) -> _Thread:
        """Register a thread that is about to start; it takes its first turn when it calls ``take_part``."""
        made = self._add(name)
        made.waits.append(_Wait("start", next(self._numbers)))
        return made

    def take_part(self, thread: _Thread, work: Callable[[], None]) -> None:
        """Do the work of a registered thread, in turns."""
        self._begin(thread)
        try:
            work()
        finally:
            self._retire(thread)

    def now(self) -> int:
        """Return the time of the tick [ns]."""
        return self._clock.now()

    def lock(self) -> TurnLock:
        return TurnLock(self)

    def worker(self, name: str, work: Callable[[], bool]) -> Worker:
        made = TurnWorker(self._add(name))
        made.thread.waits.append(_Wait("idle", next(self._numbers)))

        def run() -> None:
            self._begin(made.thread)
            try:
                while made.open:
                    while made.open and work():
                        pass
                    if made.open:
                        self._park(made.thread, _Wait("idle", next(self._numbers)))
            finally:
                self._retire(made.thread)

        threading.Thread(target=run, name=name, daemon=True).start()
        return made

    def stop(self) -> None:
        self._stopped = True
        self._free.stop()

    def rest(self, seconds: float) -> None:
        self._free.rest(seconds)

    @contextmanager
    def outside(self, what: str) -> Iterator[None]:
        """Release the turn while the calling thread waits for something external, e.g. a key; it resumes at a tick."""
        me = self._me()
        if me is None or self._holder is not me:
            yield
            return
        self._release(me)
        try:
            yield
        finally:
            self._park(me, _Wait("returned", next(self._numbers)))

    def adopt(self) -> None:
        """Make the calling thread the node's: it checks conditions, and neither takes turns nor is slowed down."""
        self._local.node = True

    def identity(self) -> object:
        """Return the running thread: the one that takes turns, or the operating system's."""
        return self._me() or threading.get_ident()

    def retire_main(self) -> None:
        """Remove the main thread from the turns; called by that thread."""
        if (me := self._me()) is not None:
            self._retire(me)

    @property
    def stopped(self) -> bool:
        """Whether all waits are ended."""
        return self._stopped

    def run(self, meanwhile: Callable[[], None]) -> None:
        """Let all due threads take their turns; ``meanwhile`` is called while one lasts."""
        for each in self._threads:
            each.points = 0.0
        first = True
        while True:
            self._passes += 1
            ran = False
            for phase in (self._workers, self._sleepers, self._others):
                for each in phase():
                    if each.passed != self._passes and each.waits and self._is_due(each.waits[-1], each, first):
                        each.passed = self._passes
                        self._give(each, meanwhile)
                        ran = True
            first = False
            if not ran:
                return

    def idle_until(self) -> int:
        """Return the time [ns] before which no thread takes a turn unless a message arrives; 0 if one may take its
        turn at any tick.
        """
        until = NEVER_NS
        for each in self._threads:
            if not each.waits or each.notified:
                return 0
            wait = each.waits[-1]
            if wait.kind not in ("idle", "sleep") and not wait.by_messages:
                return 0
            if wait.until is not None:
                until = min(until, wait.until)
        return until

    def wait_for_turn(self, meanwhile: Callable[[], None]) -> None:
        """Wait until the thread that has the turn ends it."""
        began = named = time.monotonic()
        while not self._returned.acquire(timeout=LOOK_S):
            meanwhile()
            if (now := time.monotonic()) - named > SLOW_S and (holder := self._holder) is not None:
                named = now
                self._warn(
                    f"{holder.name} has been computing, or waiting for something external, for {now - began:.0f} s; "
                    f"the simulation waits for it: {place_of(holder.ident)}"
                )

    def _workers(self) -> list[_Thread]:
        return [each for each in self._threads if each.waits and each.waits[-1].kind == "idle"]

    def _sleepers(self) -> list[_Thread]:
        found = [each for each in self._threads if each.waits and each.waits[-1].kind == "sleep"]
        return sorted(found, key=lambda each: (each.waits[-1].until or 0, each.waits[-1].number))

    def _others(self) -> list[_Thread]:
        return [each for each in self._threads if each.waits and each.waits[-1].kind not in ("idle", "sleep")]

    def _is_due(self, wait: _Wait, thread: _Thread, first: bool) -> bool:
        if wait.kind == "idle":
            notified, thread.notified = thread.notified, False
            return notified
        if wait.kind in ("start", "returned"):
            return True
        if wait.kind == "over":
            return False
        if wait.kind == "budget":
            return first or self._stopped
        if self._stopped or self._clock.epoch != wait.epoch:
            return True
        if wait.until is not None and self._clock.now() >= wait.until:
            return True
        if wait.ready is None:
            return False
        try:
            wait.outcome = bool(wait.ready())
        except Exception:  # noqa: BLE001 - it is raised again in the thread, which asks once more
            return True
        return wait.outcome

    def _give(self, thread: _Thread, meanwhile: Callable[[], None]) -> None:
        self._holder = thread
        if thread.go.locked():
            thread.go.release()
        self.wait_for_turn(meanwhile)

    def _park(self, me: _Thread, wait: _Wait) -> None:
        me.waits.append(wait)
        try:
            self._release(me)
            while True:
                me.go.acquire()
                if self._holder is me:
                    return
        finally:
            me.waits.remove(wait)

    def _release(self, me: _Thread) -> None:
        if self._holder is me:
            self._holder = None
            self._returned.release()

    def _begin(self, me: _Thread) -> None:
        me.ident = threading.get_ident()
        self._local.thread = me
        while True:
            me.go.acquire()
            if self._holder is me:
                break
        me.waits.clear()

    def _retire(self, me: _Thread) -> None:
        me.ended = True
        self._threads = [each for each in self._threads if each is not me]
        self._local.thread = None
        self._release(me)

    def _add(self, name: str) -> _Thread:
        made = _Thread(name, next(self._numbers))
        self._threads = [*self._threads, made]
        return made

    def _note_unknown_thread(self) -> None:
        if not self._unknown_thread_noted:
            self._unknown_thread_noted = True
            name = threading.current_thread().name
            self._warn(f"the thread {name} does not take turns, so this run may not be repeatable")

    def _is_node(self) -> bool:
        return getattr(self._local, "node", False)

    def _me(self) -> _Thread | None:
        found: _Thread | None = getattr(self._local, "thread", None)
        return found


class _Spawned(threading.Thread):
    """A thread that counts as ended when its last turn ends, not when the operating system notices."""

    def __init__(self, turns: TurnThreads, target: Callable[[], None], name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._turns, self._work = turns, target
        self._turn = turns.enroll(name)

    def run(self) -> None:
        self._turns.take_part(self._turn, self._work)

    def is_alive(self) -> bool:
        return not self._turn.ended

    def join(self, timeout: float | None = None) -> None:
        self._turns.wait_until(lambda: self._turn.ended, timeout, by_messages=True)


class TurnWorker:
    """A worker that takes its turn at the tick at which it was notified."""

    def __init__(self, thread: _Thread) -> None:
        self.thread = thread
        self.open = True

    def notify(self) -> None:
        self.thread.notified = True

    def follow(self, samples: ThreadedSubscriber) -> None:
        raise NotImplementedError("in lockstep samples are handed over at ticks")

    def close(self) -> None:
        self.open = False
        self.thread.notified = True


class TurnLock:
    """A reentrant lock; a thread that waits for it ends its turn."""

    def __init__(self, threads: TurnThreads) -> None:
        self._threads = threads
        self._owner: object = None
        self._count = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Acquire the lock; return False if it is not free in time."""
        me = self._threads.identity()
        if self._owner is not None and self._owner != me:
            if not blocking:
                return False
            patience = None if timeout is None or timeout < 0 else timeout
            if not self._threads.wait_until(lambda: self._owner is None, patience, by_messages=True):
                return False
        self._owner = me
        self._count += 1
        return True

    def release(self) -> None:
        """Release the lock."""
        if self._owner != self._threads.identity():
            raise RuntimeError("cannot release un-acquired lock")
        self._count -= 1
        if not self._count:
            self._owner = None

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *exception: object) -> None:
        self.release()


def place_of(ident: int | None) -> str:
    """Return the location of a thread: the innermost line outside this project and Python's library."""
    frame = sys._current_frames().get(ident or 0)
    for _ in range(_LOOKS):
        if frame is None or frame.f_lineno is not None:
            break
        time.sleep(0.001)  # between two lines it has none
        frame = sys._current_frames().get(ident or 0)
    library = sys.base_prefix
    place = ""
    while frame is not None:
        file = frame.f_code.co_filename
        if not file.startswith((str(ROOT / "services"), library, "<")) and "site-packages" not in file:
            return f"{file}:{frame.f_lineno} in {frame.f_code.co_name}"
        place = place or f"{file}:{frame.f_lineno}"
        frame = frame.f_back
    return place


def _nothing() -> None:
    pass
