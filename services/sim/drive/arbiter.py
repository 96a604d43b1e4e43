"""Chooses the command that a base follows: priorities of sources, time-outs, and the emergency stop."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from messages.geometry import FASTEST_ANGULAR, FASTEST_LINEAR

SECOND = 1_000_000_000

STANDSTILL = 1e-9
"""m/s and rad/s; a command below it counts as 0, so that no denormal number reaches a wheel."""


class Decision(NamedTuple):
    """The current decision: follow the command of ``source``, or brake to a stop. ``vy`` is sideways, m/s."""

    v: float
    w: float
    braking: bool
    source: bytes | None
    vy: float = 0.0


BRAKE = Decision(0.0, 0.0, True, None)


class _Command(NamedTuple):
    """The last valid command of a source: issued at ``stamp``, valid to ``until`` [ns]; ``order`` grows with each."""

    priority: int
    v: float
    w: float
    stamp: int
    until: float
    order: int
    vy: float = 0.0


class Arbiter:
    """Chooses the command that a base follows. All times are simulation time, ns.

    It is the command of the highest priority among those not older than ``timeout`` [s]; among equal priorities, the
    last to arrive. A command's age counts from its stamp if it has one, else from its arrival. With ``timeout`` 0 a
    command holds until its publisher is gone. When none is left, the base brakes. ``exclusive`` allows one commander at
    a time: while several have live commands, ``conflict`` is true, the base brakes, and each new command is refused.

    ``commands``, ``refused`` and ``stale_dropped`` count what was received; ``commands_timed_out`` counts how often a
    moving base was left without a live command. ``last_command`` [ns] is the stamp of the last accepted command.
    ``decision`` holds until ``until`` [ns], unless something arrives.
    """

    def __init__(self, timeout: float = 0.25, exclusive: bool = False) -> None:
        self._exclusive, self._timeout = exclusive, _timeout_ns(timeout)
        self._active: dict[bytes, _Command] = {}
        self.decision, self.until = BRAKE, inf
        self.e_stopped = False
        self.timed_out = self.conflict = False
        self.clear_counts()

    def accept(
        self, source: bytes, priority: int, v: float, w: float, stamp_ns: int | None, now_ns: int, vy: float = 0.0
    ) -> bool:
        """Process a command issued at ``stamp_ns`` (None if unknown) and received at ``now_ns``; return whether it is
        accepted.

        Speeds that are not finite or beyond ``messages.geometry``'s bounds are refused and counted. Commands older than
        the time-out are dropped as stale, as are those from the future: they were made before time was set back. During
        an emergency stop commands are counted but not kept, so none moves the base after it.
        """
        # Written so that NaN fails.
        linear = -FASTEST_LINEAR <= v <= FASTEST_LINEAR and -FASTEST_LINEAR <= vy <= FASTEST_LINEAR
        if not (linear and -FASTEST_ANGULAR <= w <= FASTEST_ANGULAR):
            self.refused += 1
            return False
        issued_ns = now_ns if stamp_ns is None else stamp_ns
        if not 0 <= now_ns - issued_ns <= self._timeout:
            self.stale_dropped += 1
            return False
        v = v if abs(v) >= STANDSTILL else 0.0
        w = w if abs(w) >= STANDSTILL else 0.0
        vy = vy if abs(vy) >= STANDSTILL else 0.0
        if not self.e_stopped:
            order = self.commands + self.refused
            self._active[source] = _Command(priority, v, w, issued_ns, issued_ns + self._timeout, order, vy)
            self._choose(now_ns)
            if self.conflict:
                self.refused += 1
                return False
        self.commands += 1
        self.last_command = max(0, issued_ns)
        return True

    def publisher_lost(self, source: bytes, now_ns: int) -> None:
        """Discard the command of the publisher ``source``, which is gone, whatever its age."""
        if self._active.pop(source, None) is not None:
            self._choose(now_ns)

    def reconfigure(self, timeout: float, exclusive: bool, now_ns: int) -> None:
        """Set the time-out [s] and the rule from now on; they also apply to commands already received."""
        if (exclusive, _timeout_ns(timeout)) == (self._exclusive, self._timeout):
            return
        self._exclusive, self._timeout = exclusive, _timeout_ns(timeout)
        self._active = {
            source: each._replace(until=each.stamp + self._timeout) for source, each in self._active.items()
        }
        self._choose(now_ns)

    def set_e_stop(self, on: bool) -> None:
        """Stop at once and stay stopped until ``set_e_stop(False)``; then only later commands are followed."""
        self.e_stopped = on
        if on:
            self.clear()

    def clear(self) -> None:
        """Discard all commands, e.g. when simulation time restarts; an emergency stop and the counts stay."""
        self._active.clear()
        self.decision, self.until = BRAKE, inf
        self.timed_out = self.conflict = False

    def clear_counts(self) -> None:
        """Restart all counts at 0, when simulation time does."""
        self.commands = self.refused = self.stale_dropped = self.commands_timed_out = 0
        self.last_command = 0

    def decide(self, now_ns: int) -> Decision:
        """Return what the base does at ``now_ns``."""
        if now_ns > self.until:
            self._choose(now_ns)
        return self.decision

    def _choose(self, now_ns: int) -> None:
        before = self.decision
        self._active = {source: command for source, command in self._active.items() if now_ns <= command.until}
        self.conflict = self._exclusive and len(self._active) > 1
        if self.conflict:
            self.decision, self.until = BRAKE, min(each.until for each in self._active.values())
            return
        if not self._active:
            self.timed_out = self.timed_out or not before.braking
            if before.v or before.w or before.vy:
                self.commands_timed_out += 1
            self.decision, self.until = BRAKE, inf
            return
        source, best = max(self._active.items(), key=lambda item: (item[1].priority, item[1].order))
        self.decision, self.until = Decision(best.v, best.w, False, source, best.vy), best.until
        self.timed_out = False


def _timeout_ns(timeout: float) -> float:
    """Convert a time-out from s to ns; 0 means none."""
    return round(timeout * SECOND) if timeout > 0 else inf
