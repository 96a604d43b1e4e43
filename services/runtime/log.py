"""The log of a node: lines on stderr and on /rosout, throttled per call site on request."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

from messages.rosgraph import DEBUG, ERROR, FATAL, INFO, WARN
from messages.rosgraph import Log as LogLine
from messages.std import Header, Time

LEVELS = {"debug": DEBUG, "info": INFO, "warn": WARN, "error": ERROR, "fatal": FATAL}
_LONGEST = 10_000
"""Maximum characters of a line on /rosout, whose readers refuse a larger message; stderr has the whole line."""
_NAMES = {value: name.upper() for name, value in LEVELS.items()}


class Log:
    """Writes ``[12.345] WARN /tb3_0/waypoint: text``; the time is simulation time.

    ``every`` [s of wall time] throttles one call site: lines in between are counted, and the next one shows how many.
    A text may be any value, as for ``print``.
    """

    def __init__(self, node: str, level: str = "info", out: TextIO | None = None) -> None:
        self.node = node
        self.now: Callable[[], int] = lambda: 0
        self.publish: Callable[[LogLine], None] | None = None
        self._threshold = LEVELS[level]
        self._out = out
        self._sites: dict[tuple[str, int], tuple[float, int]] = {}

    def debug(self, text: object, every: float = 0.0) -> None:
        """Log details for developers."""
        self._write(DEBUG, text, every)

    def info(self, text: object, every: float = 0.0) -> None:
        """Log normal progress."""
        self._write(INFO, text, every)

    def warn(self, text: object, every: float = 0.0) -> None:
        """Log a problem with which the node can continue."""
        self._write(WARN, text, every)

    def error(self, text: object, every: float = 0.0) -> None:
        """Log a failure."""
        self._write(ERROR, text, every)

    def _write(self, level: int, text: object, every: float) -> None:
        if level < self._threshold:
            return
        frame = sys._getframe(2)
        file, line = frame.f_code.co_filename, frame.f_lineno
        if every > 0.0:
            last, kept_back = self._sites.get((file, line), (-every, 0))
            wall = time.monotonic()
            if wall - last < every:
                self._sites[file, line] = last, kept_back + 1
                return
            self._sites[file, line] = wall, 0
            if kept_back:
                text = f"{text} ({kept_back} more like this)"
        now = self.now()
        out = self._out or sys.stderr
        out.write(f"[{now / 1e9:.3f}] {_NAMES[level]} {self.node}: {text}\n")
        out.flush()
        if self.publish is not None:
            header = Header(stamp=Time.of(now))
            function = frame.f_code.co_name
            self.publish(
                LogLine(
                    header=header,
                    level=level,
                    name=self.node,
                    msg=_encodable(text),
                    file=_encodable(file),
                    function=function,
                    line=line,
                )
            )


def _encodable(value: object) -> str:
    """Return the text of any value for a message, without characters that UTF-8 lacks, and at most _LONGEST ones."""
    text = str(value).encode(errors="replace").decode()
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
