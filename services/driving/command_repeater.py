"""Decides when to publish a manual command: on change, repeatedly while held, zero for a while, then nothing."""

from __future__ import annotations

from math import inf
from typing import Generic, Literal, TypeVar

Command = TypeVar("Command")

MAX_SIM_PERIOD_S = 0.1
"""Simulation time [s] after which a command is repeated, whatever the wall time; bases time out at 0.25 s."""


class CommandRepeater(Generic[Command]):
    """Repeats manual commands, so that a base does not time out while a key is held.

    Args:
        rate: Repeats per second of wall time [Hz], but at least one per MAX_SIM_PERIOD_S of simulation time, so that a
            base does not time out in a simulation faster than the wall clock. 0 disables repeats: a command is sent at
            each key event, and one zero at the end.
        release_after: Simulation time [s] for which ``still`` is sent after a motion, before others may drive.
        still: The command for standing still.
    """

    def __init__(self, rate: float, release_after: float, still: Command) -> None:
        self.reconfigure(rate, release_after)
        self._zero = still
        self.state: Literal["driving", "stopping", "silent"] = "silent"
        self.sent = still
        self._last_wall = self._last_sim = self._stopping_since = 0.0

    def update(
        self, motion: Command | None, wall: float, sim: float, key_event: bool = False, stop: bool = False
    ) -> Command | None:
        """Return the command to send now; None for nothing.

        Args:
            motion: The command of the held keys; None if none is held.
            wall: Wall time [s].
            sim: Simulation time [s].
            key_event: There was a key event.
            stop: A key asked to stop, which holds the robot even while others drive it.
        """
        if motion is not None:
            again = key_event if self._period == inf else self._is_due(wall, sim)
            changed = self.state != "driving" or motion != self.sent
            self.state = "driving"
            return self._send(motion, wall, sim) if changed or again else None
        if self.state == "driving" or stop:
            self.state, self._stopping_since = "stopping", sim
            return self._send(self._zero, wall, sim)
        if self.state == "silent":
            return None
        if self._period == inf or sim - self._stopping_since >= self._release_after:
            self.state = "silent"
            return None
        return self._send(self._zero, wall, sim) if self._is_due(wall, sim) else None

    def reconfigure(self, rate: float, release_after: float) -> None:
        """Change the repeat rate [Hz] and the time [s] for which zero is sent."""
        self._period = 1 / rate if rate else inf
        self._release_after = release_after

    def reset(self) -> None:
        """Handle a reset of simulation time, after which the base has no commands."""
        self.state = "silent"

    def _is_due(self, wall: float, sim: float) -> bool:
        return wall - self._last_wall >= self._period or sim - self._last_sim >= MAX_SIM_PERIOD_S

    def _send(self, motion: Command, wall: float, sim: float) -> Command:
        self.sent, self._last_wall, self._last_sim = motion, wall, sim
        return motion
