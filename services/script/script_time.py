"""The modules ``time`` and ``datetime`` of a script, which follow simulation time unless that is wall time."""

from __future__ import annotations

import datetime as real_datetime
import time as real_time
from collections.abc import Callable
from types import ModuleType
from typing import Any, Protocol

START_TIME_NS = 1_577_836_800_000_000_000
"""The value of ``time.time()`` at simulation time 0 in lockstep, since 1970 [ns]: 2020-01-01 00:00 UTC."""


class ScriptClockOwner(Protocol):
    """These modules' interface to the kernel."""

    def now(self) -> int: ...
    def point(self, cost: float = 1.0) -> None: ...
    def pause(self, seconds: float) -> None:
        """Wait in simulation time, without an error when the process ends or time is reset."""
        ...

    def rest(self, seconds: float) -> None:
        """Wait in wall time."""
        ...


class ScriptTime:
    """The time of ``time.time``: simulation time if ``follows()``, else the system's."""

    def __init__(self, kernel: ScriptClockOwner, follows: Callable[[], bool], fixed: bool) -> None:
        self._kernel, self._follows = kernel, follows
        self._start = START_TIME_NS if fixed else 0
        self._fixed = fixed
        self._offset: int | None = None

    def time_ns(self) -> int:
        """Return the time since 1970 [ns]."""
        self._kernel.point()
        if not self._follows():
            return real_time.time_ns()
        if not self._start:
            self._start = real_time.time_ns() - self._kernel.now()
        return self._start + self._kernel.now()

    def elapsed_ns(self) -> int:
        """Return the time since an arbitrary moment [ns], for durations."""
        self._kernel.point()
        if not self._follows():
            return real_time.monotonic_ns()
        if self._offset is None:
            self._offset = 0 if self._fixed else real_time.monotonic_ns() - self._kernel.now()
        return self._offset + self._kernel.now()

    def sleep(self, seconds: float) -> None:
        """As ``time.sleep``."""
        seconds = float(seconds)
        if seconds < 0:
            raise ValueError("sleep length must be non-negative")
        if self._follows():
            self._kernel.pause(seconds)
        else:
            self._kernel.rest(seconds)


def time_module(clock: ScriptTime) -> ModuleType:
    """Return the module ``time`` on this clock."""
    made = _copy(real_time)

    def on_now(convert: Callable[..., Any]) -> Callable[..., Any]:
        return lambda seconds=None: convert(clock.time_ns() / 1e9 if seconds is None else seconds)

    def strftime(text: str, moment: Any = None) -> str:
        return real_time.strftime(text, real_time.localtime(clock.time_ns() / 1e9) if moment is None else moment)

    def asctime(moment: Any = None) -> str:
        return real_time.asctime(real_time.localtime(clock.time_ns() / 1e9) if moment is None else moment)

    made.__dict__.update(
        time=lambda: clock.time_ns() / 1e9,
        time_ns=clock.time_ns,
        monotonic=lambda: clock.elapsed_ns() / 1e9,
        monotonic_ns=clock.elapsed_ns,
        perf_counter=lambda: clock.elapsed_ns() / 1e9,
        perf_counter_ns=clock.elapsed_ns,
        clock=lambda: clock.elapsed_ns() / 1e9,
        sleep=clock.sleep,
        localtime=on_now(real_time.localtime),
        gmtime=on_now(real_time.gmtime),
        ctime=on_now(real_time.ctime),
        asctime=asctime,
        strftime=strftime,
    )
    return made


def datetime_module(clock: ScriptTime) -> ModuleType:
    """Return the module ``datetime`` on this clock."""

    class InstanceOfMoment(type):
        """Makes instances of the real ``datetime`` instances of this class."""

        def __instancecheck__(cls, instance: object) -> bool:
            return isinstance(instance, real_datetime.datetime)

    class InstanceOfDay(type):
        """The same for ``date``."""

        def __instancecheck__(cls, instance: object) -> bool:
            return isinstance(instance, real_datetime.date)

    class Moment(real_datetime.datetime, metaclass=InstanceOfMoment):
        """``datetime.datetime`` whose now is on the script's clock."""

        @classmethod
        def now(cls, tz: Any = None) -> Any:
            return cls.fromtimestamp(clock.time_ns() / 1e9, tz)

        @classmethod
        def today(cls) -> Any:
            return cls.fromtimestamp(clock.time_ns() / 1e9)

        @classmethod
        def utcnow(cls) -> Any:
            return cls.fromtimestamp(clock.time_ns() / 1e9, real_datetime.UTC).replace(tzinfo=None)

    class Day(real_datetime.date, metaclass=InstanceOfDay):
        """``datetime.date`` whose today is on the script's clock."""

        @classmethod
        def today(cls) -> Any:
            return cls.fromtimestamp(clock.time_ns() / 1e9)

    made = _copy(real_datetime)
    for each, name in ((Moment, "datetime"), (Day, "date")):
        each.__name__ = each.__qualname__ = name
        each.__module__ = "datetime"
        made.__dict__[name] = each
    return made


def _copy(module: ModuleType) -> ModuleType:
    made = ModuleType(module.__name__, module.__doc__)
    made.__dict__.update(module.__dict__)
    return made
