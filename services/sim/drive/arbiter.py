"""The choice of the command that a base obeys: sources with priorities, time-outs, and the emergency stop."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from messages.geometry import FASTEST_ANGULAR, FASTEST_LINEAR

SECOND = 1_000_000_000

STANDSTILL = 1e-9
"""m/s and rad/s; a command below it is 0: no denormal number comes near a wheel."""


class Decision(NamedTuple):
    """What a base does now: the command of ``source``, or, with ``braking``, come to a stop. ``vy`` is sideways."""

    v: float
    w: float
    braking: bool
    source: bytes | None
    vy: float = 0.0


BRAKE = Decision(0.0, 0.0, True, None)


class _Command(NamedTuple):
    """The last good command of a source, made at ``made`` and dead after ``until`` [ns]; ``turn`` grows with each."""

    priority: int
    v: float
    w: float
    stamp: int
    until: float
    order: int
    vy: float = 0.0


class Arbiter:
    """Chooses the command that a base obeys. All times are simulation time, ns.

    The command of the highest priority among those that are not older than ``timeout`` [s] is obeyed; among equal
    priorities, the last one that arrived. A command's age counts from its stamp where it has one, and from its arrival
    otherwise. With ``timeout`` 0 a command holds until its publisher is gone. When nothing is left, the base brakes.
    ``exclusive`` allows one commander at a time: while commands of several live, the base brakes, and each that comes
    is refused; ``contested`` says so.
    ``commands``, ``refused`` and ``stale_dropped`` count what was offered; ``commands_timed_out`` counts how often a
    base that had been told to move was left without a live command. ``last_command`` [ns] is when the newest of the
    accepted was made. ``decision`` holds until ``until`` [ns], unless something comes.
    """

    def __init__(self, timeout: float = 0.25, exclusive: bool = False) -> None:
        self._exclusive, self._timeout = exclusive, _timeout_ns(timeout)
        self._active: dict[bytes, _Command] = {}
        self.decision, self.until = BRAKE, inf
        self.e_stopped = False
        self.timed_out = self.conflict = False
        self.commands = self.refused = self.stale_dropped = self.commands_timed_out = 0
        self.last_command = 0

    def accept(
        self, source: bytes, priority: int, v: float, w: float, stamp_ns: int | None, now_ns: int, vy: float = 0.0
    ) -> bool:
        """Take a command made at ``stamp_ns`` (None if unknown) that arrived at ``now_ns``; True if it is accepted.

        Refused and counted are speeds that are not finite or beyond ``messages.geometry``'s bounds. Dropped as stale
        are commands older than the time-out, and those from the future: they were made before time was set back.
        During an emergency stop commands count but are not kept, so none moves the base when it is over.
        """
        # Comparisons that a NaN fails.
        linear = -FASTEST_LINEAR <= v <= FASTEST_LINEAR and -FASTEST_LINEAR <= vy <= FASTEST_LINEAR
        if not (linear and -FASTEST_ANGULAR <= w <= FASTEST_ANGULAR):
            self.refused += 1
            return False
        made = now_ns if stamp_ns is None else stamp_ns
        if not 0 <= now_ns - made <= self._timeout:
            self.stale_dropped += 1
            return False
        v = v if abs(v) >= STANDSTILL else 0.0
        w = w if abs(w) >= STANDSTILL else 0.0
        vy = vy if abs(vy) >= STANDSTILL else 0.0
        if not self.e_stopped:
            order = self.commands + self.refused
            self._active[source] = _Command(priority, v, w, made, made + self._timeout, order, vy)
            self._choose(now_ns)
            if self.conflict:
                self.refused += 1
                return False
        self.commands += 1
        self.last_command = max(0, made)
        return True

    def publisher_lost(self, source: bytes, now_ns: int) -> None:
        """The publisher ``source`` is gone: its command counts no more, whatever its age."""
        if self._active.pop(source, None) is not None:
            self._choose(now_ns)

    def reconfigure(self, timeout: float, exclusive: bool, now_ns: int) -> None:
        """Judge by another time-out [s] and rule from now on, the commands that have come, too."""
        if (exclusive, _timeout_ns(timeout)) == (self._exclusive, self._timeout):
            return
        self._exclusive, self._timeout = exclusive, _timeout_ns(timeout)
        self._active = {
            source: each._replace(until=each.stamp + self._timeout) for source, each in self._active.items()
        }
        self._choose(now_ns)

    def set_e_stop(self, on: bool) -> None:
        """Stop at once and stay so until ``e_stop(False)``; then only commands that arrive later are obeyed."""
        self.e_stopped = on
        if on:
            self.clear()

    def clear(self) -> None:
        """Forget all commands, as when simulation time restarts; an emergency stop and the counts stay."""
        self._active.clear()
        self.decision, self.until = BRAKE, inf
        self.timed_out = self.conflict = False

    def decide(self, now_ns: int) -> Decision:
        """What the base does at ``now_ns``."""
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
    """A time-out [s] in ns; 0 is none."""
    return round(timeout * SECOND) if timeout > 0 else inf
