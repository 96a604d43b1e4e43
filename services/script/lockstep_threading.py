"""The modules ``threading``, ``_thread`` and ``queue`` of a script in lockstep: a wait ends the thread's turn."""

from __future__ import annotations

import _thread
import importlib.util
import threading as real_threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import ModuleType
from typing import Any

from services.script.turns import TurnLock, TurnThreads


def threading_module(turns: TurnThreads) -> ModuleType:
    """Return the module ``threading`` on these turns."""

    class Lock(TurnLock):
        """A lock that is not reentrant."""

        def __init__(self) -> None:
            super().__init__(turns)

        def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
            if self._owner is not None:
                if not blocking:
                    return False
                patience = None if timeout is None or timeout < 0 else timeout
                if not turns.wait_until(lambda: self._owner is None, patience, by_messages=True):
                    return False
            self._owner, self._count = self, 1
            return True

        def release(self) -> None:
            if self._owner is None:
                raise RuntimeError("release unlocked lock")
            self._owner = None

        def locked(self) -> bool:
            """Return whether it is held."""
            return self._owner is not None

    class RLock(TurnLock):
        """A reentrant lock."""

        def __init__(self) -> None:
            super().__init__(turns)

    class Condition:
        """A condition variable."""

        def __init__(self, lock: Any = None) -> None:
            self._lock = RLock() if lock is None else lock
            self.acquire, self.release = self._lock.acquire, self._lock.release
            self._waiting: list[list[bool]] = []

        def __enter__(self) -> Any:
            return self._lock.__enter__()

        def __exit__(self, *exception: object) -> None:
            self._lock.__exit__(*exception)

        def wait(self, timeout: float | None = None) -> bool:
            """Wait to be notified; return False on timeout."""
            called = [False]
            self._waiting.append(called)
            held = self._lock._count
            for _ in range(held):
                self._lock.release()
            try:
                return turns.wait_until(lambda: called[0], timeout, by_messages=True)
            finally:
                if called in self._waiting:
                    self._waiting.remove(called)
                for _ in range(held):
                    self._lock.acquire()

        def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
            """Wait until ``predicate()`` holds."""
            end = None if timeout is None else turns.now() + round(timeout * 1e9)
            while not (result := predicate()):
                left = None if end is None else (end - turns.now()) / 1e9
                if (left is not None and left <= 0) or (not self.wait(left) and turns.stopped):
                    break
            return result

        def notify(self, n: int = 1) -> None:
            """Wake ``n`` waiting threads."""
            for called in self._waiting[:n]:
                called[0] = True
            del self._waiting[:n]

        def notify_all(self) -> None:
            """Wake all waiting threads."""
            self.notify(len(self._waiting))

        notifyAll = notify_all

    class Event:
        """A flag that threads wait for."""

        def __init__(self) -> None:
            self._flag = False

        def is_set(self) -> bool:
            """Return whether it is set."""
            turns.point(1.0)
            return self._flag

        isSet = is_set

        def set(self) -> None:
            """Set the flag and wake all waiting threads."""
            self._flag = True

        def clear(self) -> None:
            """Reset the flag."""
            self._flag = False

        def wait(self, timeout: float | None = None) -> bool:
            """Wait until the flag is set; return False on timeout."""
            turns.wait_until(lambda: self._flag, timeout, by_messages=True)
            return self._flag

    class Semaphore:
        """A counting semaphore."""

        def __init__(self, value: int = 1) -> None:
            if value < 0:
                raise ValueError("semaphore initial value must be >= 0")
            self._value = value

        def acquire(self, blocking: bool = True, timeout: float | None = None) -> bool:
            """Decrement the counter; return False if it stays 0 for the timeout."""
            if self._value == 0 and (
                not blocking or not turns.wait_until(lambda: self._value > 0, timeout, by_messages=True)
            ):
                return False
            self._value -= 1
            return True

        def release(self, n: int = 1) -> None:
            """Increment the counter by ``n``."""
            self._value += n

        def __enter__(self) -> bool:
            return self.acquire()

        def __exit__(self, *exception: object) -> None:
            self.release()

    class BoundedSemaphore(Semaphore):
        """A semaphore that cannot be released more often than acquired."""

        def __init__(self, value: int = 1) -> None:
            super().__init__(value)
            self._most = value

        def release(self, n: int = 1) -> None:
            if self._value + n > self._most:
                raise ValueError("Semaphore released too many times")
            super().release(n)

    class Barrier(real_threading.Barrier):
        """A barrier whose waits end turns."""

        def __init__(
            self, parties: int, action: Callable[[], None] | None = None, timeout: float | None = None
        ) -> None:
            super().__init__(parties, action, timeout)
            self._cond = Condition(Lock())

    class Thread(real_threading.Thread):
        """A thread that takes turns."""

        def start(self) -> None:
            if getattr(self, "_turn", None) is not None:
                raise RuntimeError("threads can only be started once")
            inner = self.run
            self._turn = turns.enroll(self.name)
            self.run = lambda: turns.take_part(self._turn, inner)  # type: ignore[method-assign]
            super().start()

        def is_alive(self) -> bool:
            turn = getattr(self, "_turn", None)
            return turn is not None and not turn.ended

        def join(self, timeout: float | None = None) -> None:
            turn = getattr(self, "_turn", None)
            if turn is None:
                raise RuntimeError("cannot join thread before it is started")
            turns.wait_until(lambda: turn.ended, timeout, by_messages=True)

    class Timer(Thread):
        """A thread that calls a function after a delay."""

        def __init__(
            self,
            interval: float,
            function: Callable[..., Any],
            args: tuple[Any, ...] | list[Any] | None = None,
            kwargs: Mapping[str, Any] | None = None,
        ) -> None:
            super().__init__()
            self.interval, self.function = interval, function
            self.args, self.kwargs = args or [], kwargs or {}
            self.finished = Event()

        def cancel(self) -> None:
            """Cancel the call."""
            self.finished.set()

        def run(self) -> None:
            if not self.finished.wait(self.interval) and not turns.stopped:
                self.function(*self.args, **self.kwargs)
            self.finished.set()

    made = ModuleType("threading", real_threading.__doc__)
    made.__dict__.update(real_threading.__dict__)
    for each in (Lock, RLock, Condition, Event, Semaphore, BoundedSemaphore, Barrier, Thread, Timer):
        setattr(made, each.__name__, each)
    return made


def thread_module(threading: ModuleType) -> ModuleType:
    """Return the module ``_thread``, Python 2's ``thread``, with the threads and locks of this ``threading``."""

    def start_new_thread(
        function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any] | None = None
    ) -> int:
        def run() -> None:
            with suppress(SystemExit):  # raised by exit()
                function(*args, **(kwargs or {}))

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        return int(thread.ident)

    made = ModuleType("_thread", _thread.__doc__)
    made.__dict__.update(_thread.__dict__)
    made.__dict__.update(start_new_thread=start_new_thread, start_new=start_new_thread)
    made.__dict__.update(allocate_lock=threading.Lock, allocate=threading.Lock, LockType=threading.Lock)
    made.__dict__.update(RLock=threading.RLock)
    return made


def queue_module(threading: ModuleType, time: ModuleType, import_module: Callable[..., Any]) -> ModuleType:
    """Return the module ``queue``, built from Python's own source on these modules."""
    spec = importlib.util.find_spec("queue")
    assert spec is not None
    assert spec.origin is not None
    made = ModuleType("queue")
    builtins = dict(__import__("builtins").__dict__)

    def importing(name: str, *rest: Any, **more: Any) -> Any:
        if name == "_queue":
            raise ImportError("its queues wait outside of turns")
        return {"threading": threading, "time": time}.get(name) or import_module(name, *rest, **more)

    builtins["__import__"] = importing
    made.__dict__["__builtins__"] = builtins
    with open(spec.origin, "rb") as file:
        exec(compile(file.read(), spec.origin, "exec"), made.__dict__)
    made.__dict__["Empty"], made.__dict__["Full"] = _errors()
    return made


def _errors() -> tuple[type[Exception], type[Exception]]:
    import queue

    return queue.Empty, queue.Full
