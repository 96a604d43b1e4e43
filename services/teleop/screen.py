"""The status lines of teleop in the terminal."""

from __future__ import annotations

import contextlib
import os
import select
from dataclasses import dataclass

from messages.elea import BaseStatus
from messages.geometry import Twist
from services.teleop.keys import KEY_TABLE, Velocity

REFRESH_PERIOD_S = 0.1
"""Wall time [s] between updates."""
STDOUT = 1
TURTLE_TEXT = "a turtle: obeys its last command for a second"


@dataclass(frozen=True)
class View:
    """The contents of the screen: set speeds, the command sent, and the state of the robot.

    ``sent`` is None while nothing is sent; ``error`` describes a problem with the network or the clock. A ``turtle``
    has no status.
    """

    node: str
    speed: float
    turn: float
    at_limit: bool
    sent: Velocity | None
    odometry_twist: Twist | None
    base_status: BaseStatus | None
    error: str = ""
    turtle: bool = False


def header_text(topic: str) -> str:
    """Return the header, which is printed once."""
    return f"\ndriving {topic}\n\n{KEY_TABLE}\n"


def render_lines(view: View) -> tuple[str, ...]:
    """Return the status lines."""
    limit = "   (the limit)" if view.at_limit else ""
    return (
        f"   set     speed {view.speed:.2f} m/s   turn {view.turn:.2f} rad/s{limit}",
        f"   sends   {_command_text(view.sent)}",
        f"   robot   {_odometry_text(view.odometry_twist)}",
        f"   base    {view.error or (TURTLE_TEXT if view.turtle else _base_text(view.base_status, view.node))}",
    )


def _command_text(sent: Velocity | None) -> str:
    if sent is None:
        return "nothing: others may drive"
    if not any(sent):
        return "stop"
    parts = zip((sent.x, sent.y, sent.z), ("ahead", "left", "up"), strict=True)
    named = [f"{value:+.2f} m/s {name}" for value, name in parts if value]
    return "   ".join((*named, f"{sent.yaw:+.2f} rad/s") if sent.yaw else named)


def _odometry_text(twist: Twist | None) -> str:
    if twist is None:
        return "no odometry"
    # Adding 0 removes the sign of a negative zero.
    return f"{round(twist.linear.x, 2) + 0:+.2f} m/s   {round(twist.angular.z, 2) + 0:+.2f} rad/s"


def _base_text(base: BaseStatus | None, node: str) -> str:
    if base is None:
        return "no status: is the robot still in the simulation?"
    if base.e_stopped:
        by = f" by {', '.join(base.stopped_by)}" if base.stopped_by else ""
        return f"EMERGENCY STOP{by}, until false is sent on e_stop"
    what = {"": "no commands", node: "obeys these keys"}.get(base.source, f"obeys {base.source}")
    return f"{what}, touches something" if base.colliding else what


class Screen:
    """Standard output, if it is a terminal. Never blocks: what cannot be written is skipped."""

    def __init__(self, descriptor: int = STDOUT) -> None:
        self._descriptor = descriptor
        self._last_lines: tuple[str, ...] = ()
        self._due = 0.0
        self._enabled = os.isatty(descriptor)

    def print_header(self, topic: str) -> None:
        """Print the key table."""
        if self._enabled:
            self._write(header_text(topic))

    def update(self, view: View, wall: float) -> None:
        """Redraw the lines, at most every REFRESH_PERIOD_S of ``wall`` [s]."""
        if not self._enabled or wall < self._due:
            return
        self._due = wall + REFRESH_PERIOD_S
        width = self._width()
        drawn = tuple(line[: width - 1] for line in render_lines(view))
        if drawn == self._last_lines:
            return
        up = f"\x1b[{len(self._last_lines)}A" if self._last_lines else ""
        if self._write(up + "".join(f"\r{line}\x1b[K\n" for line in drawn)):
            self._last_lines = drawn

    def _width(self) -> int:
        try:
            return os.get_terminal_size(self._descriptor).columns or 80
        except OSError:
            return 80

    def _write(self, text: str) -> bool:
        with contextlib.suppress(OSError):
            if select.select([], [self._descriptor], [], 0)[1]:
                os.write(self._descriptor, text.encode())
                return True
        return False
