"""The keyboard of a Linux terminal: raw input, decoded into key events; the terminal is restored at exit."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import threading
import time
from typing import Any, Self

from services.runtime.errors import BadInput, Stopped
from services.teleop.keys import KeyEvent

ESCAPE_TIMEOUT_S = 0.05
"""A byte later than this after an escape does not belong to its sequence."""
OTHER_KEY = "other"
"""Stands for every key without a printable ASCII character: arrows, function keys, letters with accents."""


class KeyDecoder:
    """Takes a terminal's bytes apart.

    An escape sequence is one key without a meaning here, however it is cut: the O in the one of F1, or of an arrow,
    must not drive the robot. It counts as soon as it begins, since it stops the robot.
    """

    def __init__(self) -> None:
        self._state = ""
        self._last_time = 0.0

    def feed(self, data: bytes, at: float, stall: float = 0.0) -> list[KeyEvent]:
        """The keys in ``data``, read at ``at`` [s] after a ``stall``."""
        if self._state and at - self._last_time > ESCAPE_TIMEOUT_S:
            self._state = ""
        self._last_time = at
        return [KeyEvent(key, at, stall=stall) for byte in data if (key := self._key(byte))]

    def _key(self, byte: int) -> str:
        """The key that a byte is or begins; empty inside of one."""
        if byte == 0x1B:
            self._state = "escape"
            return OTHER_KEY
        match self._state:
            case "escape":
                # ESC [ ... final byte; ESC O byte; ESC byte is a key with Alt.
                self._state = {0x5B: "control", 0x4F: "single"}.get(byte, "")
                return ""
            case "control":
                if 0x40 <= byte <= 0x7E:
                    self._state = ""
                return ""
            case "single":
                self._state = ""
                return ""
        return chr(byte) if 0x20 <= byte <= 0x7E else OTHER_KEY


STDIN = 0
STALL_S = 0.05
"""A reader that comes back later than this beyond its time was held up."""
_MAX_BYTES = 4096
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
        self._decoder = KeyDecoder()
        self._last_read = time.monotonic()

    def __enter__(self) -> Self:
        require_terminal(self._descriptor)
        self._saved_attributes = termios.tcgetattr(self._descriptor)
        self._previous_excepthook = threading.excepthook
        threading.excepthook = self._thread_died
        termios.tcsetattr(self._descriptor, termios.TCSAFLUSH, _unbuffered(self._saved_attributes))
        return self

    def __exit__(self, *exception: object) -> None:
        self.restore()
        threading.excepthook = self._previous_excepthook

    def restore(self) -> None:
        """Give the terminal back; what was typed and not read does not reach the shell. It may be gone."""
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._descriptor, termios.TCSAFLUSH, self._saved_attributes)

    def read_events(self, within: float) -> list[KeyEvent]:
        """See ``keys.Keyboard``."""
        found: list[KeyEvent] = []
        try:
            if select.select([self._descriptor], [], [], max(0.0, within))[0]:
                data = os.read(self._descriptor, _MAX_BYTES)
                if not data:
                    raise Stopped("the terminal was closed")
                now = time.monotonic()
                away = now - self._last_read
                found = self._decoder.feed(data, now, away if away > within + STALL_S else 0.0)
            self._last_read = time.monotonic()
        except OSError as error:
            raise Stopped(f"the terminal is gone: {error.strerror}") from None
        return found

    def _thread_died(self, dead: threading.ExceptHookArgs) -> None:
        """The process ends at once when a thread dies, without unwinding this one."""
        self.restore()
        self._previous_excepthook(dead)


def _unbuffered(before: list[Any]) -> list[Any]:
    """The attributes for reading key by key."""
    wanted = list(before)
    wanted[_LFLAG] = before[_LFLAG] & ~(termios.ICANON | termios.ECHO | termios.IEXTEN) | termios.ISIG
    wanted[_IFLAG] = before[_IFLAG] & ~(termios.IXON | termios.ICRNL)
    wanted[_CC] = list(before[_CC])
    wanted[_CC][termios.VMIN], wanted[_CC][termios.VTIME] = 1, 0
    wanted[_CC][termios.VSUSP] = wanted[_CC][termios.VQUIT] = b"\0"
    return wanted
