"""Scripts of keys, played back as the events that a keyboard would send."""

from __future__ import annotations

import math
import re

from services.runtime.errors import BadInput
from services.teleop import TeleopParameters
from services.teleop.keys import KeyEvent

MAX_TIME_S = 1e5
"""Latest time [s] in a script."""
MAX_EVENTS = 100_000
"""Maximum number of events of a script, including repeats."""

_ROUNDING_S = 1e-6
_ENTRY = re.compile(r"(?P<key>space|up|down|left|right|[!-~])@(?P<start>\d+(?:\.\d+)?)(?:-(?P<end>\d+(?:\.\d+)?))?")


def script_events(p: TeleopParameters) -> tuple[KeyEvent, ...]:
    """Return the events of ``p.keys`` in order, with times [s] from the start of the script; raises BadInput.

    ``i@0.5`` is a tap, ``i@0.5-2`` a key held from 0.5 to 2 s: its events are at 0.5, after ``key_delay``, and then
    every ``key_interval``. As on a keyboard, a key stops repeating when another one is pressed.
    """
    holds = sorted(_hold(entry) for entry in p.keys.split())
    found: list[KeyEvent] = []
    for index, (start, end, key) in enumerate(holds):
        following = holds[index + 1][0] if index + 1 < len(holds) else math.inf
        found.append(KeyEvent(key, start))
        # Rounding must neither drop the repeat at the end nor add one after the next key.
        last = min(end + _ROUNDING_S, following - _ROUNDING_S)
        repeats = math.floor((last - start - p.key_delay) / p.key_interval) + 1
        if len(found) + repeats > MAX_EVENTS:
            raise BadInput(f"keys: a script has at most {MAX_EVENTS} events, repeats included")
        found += [KeyEvent(key, start + p.key_delay + number * p.key_interval) for number in range(max(0, repeats))]
    return tuple(found)


def _hold(entry: str) -> tuple[float, float, str]:
    """Return start, end and key of an entry; a tap ends when it starts."""
    found = _ENTRY.fullmatch(entry)
    if found is None:
        raise BadInput(
            f"keys: {entry!r} is not KEY@TIME or KEY@FROM-TO, as in i@0.5 or i@0.5-2 (s); "
            "further keys: space, up, down, left, right"
        )
    start = float(found["start"])
    end = float(found["end"] or start)
    if not start <= end <= MAX_TIME_S:
        raise BadInput(
            f"keys: {entry!r}: the release must not be earlier than the press, nor later than {MAX_TIME_S:g} s"
        )
    return start, end, " " if found["key"] == "space" else found["key"]


class KeyScript:
    """Returns the events of a script as they become due."""

    def __init__(self, events: tuple[KeyEvent, ...]) -> None:
        self._events, self._next = events, 0

    def pop_due(self, now: float) -> list[KeyEvent]:
        """Return the events due at ``now`` [s] that were not returned before."""
        first = self._next
        while not self.done and self._events[self._next].time <= now:
            self._next += 1
        return list(self._events[first : self._next])

    def rewind(self) -> None:
        """Start again."""
        self._next = 0

    @property
    def done(self) -> bool:
        """Whether all events were returned."""
        return self._next == len(self._events)
