"""The keyboard of a Linux terminal: raw input decoded into key events; the terminal is restored on exit."""

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
"""Time [s] after an escape byte beyond which a byte does not belong to its sequence."""
OTHER_KEY = "other"
"""Stands for every key without a printable ASCII character, except arrows: function keys, letters with accents."""
ARROWS = {0x41: "up", 0x42: "down", 0x43: "right", 0x44: "left"}
"""Arrow keys by the final byte of their sequences ESC [ A and ESC O A."""


class KeyDecoder:
    """Decodes a terminal's bytes into keys.

    An arrow key whose sequence arrives whole is that key. Any other escape sequence is one unbound key, however it is
    split: the O in the sequence of F1 must not drive the robot. It takes effect at its first byte, since it stops the
    robot.
    """

    def __init__(self) -> None:
        self._state = ""
        self._last_time = 0.0

    def feed(self, data: bytes, at: float, stall: float = 0.0) -> list[KeyEvent]:
        """Return the keys in ``data``, which was read at ``at`` [s] after a ``stall`` [s]."""
        if self._state and at - self._last_time > ESCAPE_TIMEOUT_S:
            self._state = ""
        self._last_time = at
        found, rest = list[str](), data
        while rest:
            if not self._state and (arrow := _arrow(rest)):
                found.append(arrow)
                rest = rest[3:]
                continue
            found.append(self._key(rest[0]))
            rest = rest[1:]
        return [KeyEvent(key, at, stall=stall) for key in found if key]

    def _key(self, byte: int) -> str:
        """Return the key that a byte is or starts; empty within a sequence."""
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


def _arrow(data: bytes) -> str:
    """Return the arrow key whose sequence ``data`` begins with; empty if there is none."""
    return ARROWS.get(data[2], "") if data[:2] in (b"\x1b[", b"\x1bO") and len(data) > 2 else ""


STDIN = 0
STALL_S = 0.05
"""Time [s] by which a read exceeds its time-out from which on the reader counts as stalled."""
_MAX_BYTES = 4096
"""Size of a terminal's input buffer in bytes."""
_IFLAG, _LFLAG, _CC = 0, 3, 6
"""Indices of termios attributes."""


def require_terminal(descriptor: int = STDIN) -> None:
    """Raise BadInput unless the descriptor is a terminal in the foreground."""
    if not os.isatty(descriptor):
        raise BadInput("standard input is not a terminal: start teleop in one, or give it a script: --keys 'i@0.5-2'")
    # tcgetpgrp fails for a terminal that is not this session's: it has no foreground.
    with contextlib.suppress(OSError):
        if os.tcgetpgrp(descriptor) != os.getpgrp():
            raise BadInput("teleop runs in the background, where no key reaches it: start it in the foreground")


class Terminal:
    """Reads standard input key by key.

    Ctrl-C remains a signal, so that it always ends the program. Ctrl-Z, Ctrl-\\, Ctrl-S and the like are
    ordinary keys: a robot must not drive on because teleop was suspended, nor teleop hang because its output was
    stopped. Earlier input is dropped.
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
        """Restore the terminal, if it still exists; unread input does not reach the shell."""
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
        """Restore the terminal when a thread dies, as the process then ends without unwinding."""
        self.restore()
        self._previous_excepthook(dead)


def _unbuffered(before: list[Any]) -> list[Any]:
    """Return the attributes for reading key by key."""
    attributes = list(before)
    attributes[_LFLAG] = before[_LFLAG] & ~(termios.ICANON | termios.ECHO | termios.IEXTEN) | termios.ISIG
    attributes[_IFLAG] = before[_IFLAG] & ~(termios.IXON | termios.ICRNL)
    attributes[_CC] = list(before[_CC])
    attributes[_CC][termios.VMIN], attributes[_CC][termios.VTIME] = 1, 0
    attributes[_CC][termios.VSUSP] = attributes[_CC][termios.VQUIT] = b"\0"
    return attributes
