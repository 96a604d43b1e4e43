"""The keyboard of a Linux terminal: keys at once and without echo, and the terminal as it was on every way out."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import threading
import time
from typing import Any, Self

from services.runtime.errors import BadInput, Stopped
from services.teleop.decode import Decoder
from services.teleop.keys import Press

STDIN = 0
STALL_S = 0.05
"""A reader that comes back later than this beyond its time was held up."""
_MOST = 4096
"""Bytes that a terminal keeps for its reader."""
_IFLAG, _LFLAG, _CC = 0, 3, 6
"""Places in what termios gives."""


def require_terminal(descriptor: int = STDIN) -> None:
    """Raise BadInput unless a person can type at it."""
    if not os.isatty(descriptor):
        raise BadInput("standard input is no terminal: start teleop in one, or give it a script with --keys 'i@0.5-2'")
    # A terminal that is not this session's has no foreground.
    with contextlib.suppress(OSError):
        if os.tcgetpgrp(descriptor) != os.getpgrp():
            raise BadInput("teleop runs in the background, where no key reaches it: start it in the foreground")


class Terminal:
    """Standard input, a key at a time.

    Ctrl-C stays a signal, so that it ends the program whatever it does. Ctrl-Z, Ctrl-\\, Ctrl-S and the like are keys
    as any other: a robot must not go on because its teleop was suspended, nor teleop hang because its output was held.
    What was typed before is dropped.
    """

    def __init__(self, descriptor: int = STDIN) -> None:
        self._descriptor = descriptor
        self._decoder = Decoder()
        self._looked = time.monotonic()

    def __enter__(self) -> Self:
        require_terminal(self._descriptor)
        self._before = termios.tcgetattr(self._descriptor)
        self._hook = threading.excepthook
        threading.excepthook = self._thread_died
        termios.tcsetattr(self._descriptor, termios.TCSAFLUSH, _by_key(self._before))
        return self

    def __exit__(self, *exception: object) -> None:
        self.restore()
        threading.excepthook = self._hook

    def restore(self) -> None:
        """Give the terminal back; what was typed and not read does not reach the shell. It may be gone."""
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._descriptor, termios.TCSAFLUSH, self._before)

    def take(self, within: float) -> list[Press]:
        """See ``keys.Keyboard``."""
        found: list[Press] = []
        try:
            if select.select([self._descriptor], [], [], max(0.0, within))[0]:
                data = os.read(self._descriptor, _MOST)
                if not data:
                    raise Stopped("the terminal was closed")
                now = time.monotonic()
                away = now - self._looked
                found = self._decoder.feed(data, now, away if away > within + STALL_S else 0.0)
            self._looked = time.monotonic()
        except OSError as error:
            raise Stopped(f"the terminal is gone: {error.strerror}") from None
        return found

    def _thread_died(self, dead: threading.ExceptHookArgs) -> None:
        """The process ends at once when a thread dies, without unwinding this one."""
        self.restore()
        self._hook(dead)


def _by_key(before: list[Any]) -> list[Any]:
    """The attributes for reading key by key."""
    wanted = list(before)
    wanted[_LFLAG] = before[_LFLAG] & ~(termios.ICANON | termios.ECHO | termios.IEXTEN) | termios.ISIG
    wanted[_IFLAG] = before[_IFLAG] & ~(termios.IXON | termios.ICRNL)
    wanted[_CC] = list(before[_CC])
    wanted[_CC][termios.VMIN], wanted[_CC][termios.VTIME] = 1, 0
    wanted[_CC][termios.VSUSP] = wanted[_CC][termios.VQUIT] = b"\0"
    return wanted
