"""A user at a terminal: a program in a pseudo-terminal of its own, with keys typed as a keyboard sends them."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, Self

from services.runtime.process import PARENT, ROOT
from tests.harness.fork_children import is_forkable
from tests.harness.fork_server import ForkedProcess
from tests.harness.waiting import wait_until
from tests.services.teleop import type_keys
from tests.services.teleop.key_repeat import key_repeat

END_S = 60.0
"""Wall time limit for a program to end."""
MAX_LATE_S = 0.05
"""How much longer than planned [s] a gap may be: half of ``DELAY_MARGIN_S``, and of ``MIN_REPEAT_TIMEOUT_S``."""

# The shell leads a new session: the terminal that it opens becomes that session's controlling terminal.
_ATTACH_TERMINAL = 'exec "$@" <>"$0" >&0 2>&0'


class KeyEvents(NamedTuple):
    """Times [s, ``time.monotonic``] at which keys were typed; ``late`` [s]: how much too long a gap was."""

    times: tuple[float, ...]
    late: float


class PseudoTerminal:
    """Runs a program under the project's Python in a terminal; ``with`` ends it."""

    def __init__(self, arguments: Sequence[str], env: dict[str, str] | None = None) -> None:
        self._master, self._slave = pty.openpty()
        self.before = termios.tcgetattr(self._slave)
        self._said = bytearray()
        self.open = True
        environment = {**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getpid()), **(env or {})}
        self._child = _start(arguments, os.ttyname(self._slave), environment)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._child.poll() is None:
            self._child.kill()
        self._child.wait(END_S)
        if self.open:
            self.close()

    @property
    def text(self) -> str:
        """The program's output so far."""
        return self._said.decode(errors="replace")

    @property
    def ended(self) -> bool:
        """Whether the program has ended."""
        return self._child.poll() is not None

    @property
    def attributes(self) -> list[Any]:
        """The terminal's attributes."""
        return termios.tcgetattr(self._slave)

    @property
    def in_raw_mode(self) -> bool:
        """Whether the terminal is in raw (non-canonical) mode."""
        return not self.attributes[3] & termios.ICANON

    def wait_ready(self) -> None:
        """Wait until the program reads keys; fail if it ends instead."""
        wait_until(lambda: self.in_raw_mode or self._child.poll() is not None, END_S, "a program that reads keys")
        assert self._child.poll() is None, self.text

    def type(self, keys: str) -> float:
        """Type keys; return the time before [s, ``time.monotonic``]."""
        now = time.monotonic()
        os.write(self._master, keys.encode())
        return now

    def hold(self, keys: str, seconds: float, delay: float = 0.5, interval: float = 0.03) -> KeyEvents:
        """Hold one key after the other for ``seconds`` each: its first event, the next after ``delay`` [s], then one
        each ``interval`` [s].
        """
        events = [
            (key, time)
            for number, key in enumerate(keys)
            for time in key_repeat(number * (seconds + interval), seconds, delay, interval)
        ]
        # In a session of its own, which Linux schedules at once, however busy the test's own session is.
        program = subprocess.run(
            [sys.executable, "-S", "-P", type_keys.__file__, str(self._master), json.dumps(events)],
            pass_fds=[self._master],
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
            check=True,
        )
        times = tuple(json.loads(program.stdout))
        behind = [typed - planned for typed, (_, planned) in zip(times, events, strict=True)]
        return KeyEvents(times, max(now - before for before, now in pairwise(behind)))

    def send_signal(self, number: signal.Signals) -> float:
        """Send the program a signal; return the time before [s, ``time.monotonic``]."""
        now = time.monotonic()
        self._child.send_signal(number)
        return now

    def close(self) -> None:
        """Close the terminal, as when its window is closed."""
        self.open = False
        # A terminal isn't closed while a thread reads it.
        self._reader.join()
        os.close(self._slave)
        os.close(self._master)

    def wait(self) -> int:
        """Wait for the program's end and return its exit status."""
        return self._child.wait(END_S)

    def _read(self) -> None:
        while self.open:
            if select.select([self._master], [], [], 0.05)[0]:
                self._said += os.read(self._master, 4096)


def _start(arguments: Sequence[str], terminal: str, environment: dict[str, str]) -> subprocess.Popen[Any]:
    if arguments[0] == "-m" and is_forkable(arguments[1]):
        return ForkedProcess(arguments[1], arguments[2:], Path.cwd(), environment, subprocess.DEVNULL, True, terminal)
    # The shell becomes the program by exec, so that the program is the child that dies with the test.
    command = ["sh", "-c", _ATTACH_TERMINAL, terminal, sys.executable, "-P", *arguments]
    return subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
    )


def hold_without_lag(act: Callable[[], KeyEvents], tries: int = 10) -> KeyEvents:
    """Repeat a hold, up to ``tries`` times, until no gap between its events may be taken for a release."""
    for _ in range(tries):
        strokes = act()
        if strokes.late < MAX_LATE_S:
            return strokes
    raise AssertionError(f"no hold of {tries} went by without a lag")
