"""The pulse of a process: by when its next heartbeat must have come."""

from __future__ import annotations

from services.runtime.health import PERIOD_S

MISSED = 3
LIMIT_S = MISSED * PERIOD_S
"""Wall time without a heartbeat after which a process hangs."""

GRACE_S = 20.0
"""Wall time that a process has for its first heartbeat: imports, models and links, on a busy machine."""

LOOK_S = LIMIT_S / 2
"""Wall time before that limit from which on it is looked at why no heartbeat comes."""

RECOVERY_S = 3.0
"""Wall time in which heartbeats must come again after what carries them was down."""


class Pulse:
    """One life's heartbeats, on a clock that the caller reads [s]."""

    def __init__(self, now: float, grace: float = GRACE_S) -> None:
        self.beaten = False
        self.held_up = 0.0
        """Time [s] of the present silence in which it could not beat, as far as it was looked at."""
        self._last, self._deadline = now, now + grace

    def heard(self, now: float) -> None:
        """A heartbeat has come."""
        self.beaten, self.held_up = True, 0.0
        self._last, self._deadline = now, now + LIMIT_S

    def excuse(self, now: float, seconds: float = RECOVERY_S) -> None:
        """Silence is not its fault at present: it has ``seconds`` from now."""
        self._deadline = max(self._deadline, now + seconds)

    def defer(self, seconds: float) -> None:
        """For ``seconds`` it could not beat, whatever it did: they do not count."""
        self.held_up += seconds
        self._deadline += seconds

    def is_late(self, now: float) -> bool:
        """Whether it is time to look for the reason of its silence."""
        return now > self._deadline - self.held_up - LOOK_S

    def well(self, now: float) -> bool:
        """Whether it beats, at most one beat late."""
        return self.beaten and now - self._last < 2 * PERIOD_S

    def hangs(self, now: float) -> bool:
        """Whether the next heartbeat is overdue."""
        return now > self._deadline

    def silence(self, now: float) -> float:
        """Time since the last heartbeat, or since the start [s]."""
        return now - self._last
