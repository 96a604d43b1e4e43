"""The channel of the log: /rosout, the newest lines kept for pages that open later."""

from __future__ import annotations

from collections import deque

from messages.rosgraph import Log
from messages.topics import ROSOUT
from services.panel.channel import as_json
from services.panel.feeds import Feeds, Hold

KEPT = 2000
"""Lines kept."""
LONGEST = 4000
"""Characters of a line that are shown."""


class LogChannel:
    """Reads the log always: it is quiet, and what was said before a page opened is what people look for."""

    period, streams = 0.2, True

    def __init__(self, feeds: Feeds) -> None:
        self.version = 0
        self._place = (ROSOUT.name, Log.ROS_TYPE)
        self._hold = Hold(feeds)
        self._hold.want({self._place: ROSOUT.quality.name})
        self._lines: deque[tuple[int, float, int, str, str, str]] = deque(maxlen=KEPT)

    def follow(self, wanted: bool) -> None:
        """It is followed in any case."""

    def turn(self, now: float) -> None:
        for line, _ in self._hold.batch(*self._place):
            self.version += 1
            place = f"{line.file.rpartition('/')[2]}:{line.line} {line.function}" if line.file else ""
            self._lines.append(
                (self.version, line.header.stamp.ns / 1e9, line.level, line.name, line.msg[:LONGEST], place)
            )

    def news(self, since: int) -> str | None:
        return as_json("log", lines=[line for line in self._lines if line[0] > since], anew=since < 0)
