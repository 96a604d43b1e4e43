"""What the person at the keys sees: a few lines that stay where they are."""

from __future__ import annotations

import contextlib
import os
import select
from dataclasses import dataclass

from messages.elea import BaseStatus
from messages.geometry import Twist
from services.teleop.bindings import KEYS
from services.teleop.hand import Motion

PERIOD_S = 0.1
"""Wall time between two looks."""
STDOUT = 1


@dataclass(frozen=True)
class View:
    """What is shown: the speeds as set and whether they are at their limits, the command that goes out, the robot.

    ``sent`` is None while nothing is sent; ``trouble`` is a sentence about the network or time, or empty.
    """

    node: str
    speed: float
    turn: float
    at_limit: bool
    sent: Motion | None
    moving: Twist | None
    base: BaseStatus | None
    trouble: str = ""


def heading(topic: str) -> str:
    """What is printed once, above."""
    return f"\ndriving {topic}\n\n{KEYS}\n"


def lines(view: View) -> tuple[str, ...]:
    """The lines that change."""
    limit = "   (the limit)" if view.at_limit else ""
    return (
        f"   set     speed {view.speed:.2f} m/s   turn {view.turn:.2f} rad/s{limit}",
        f"   sends   {_command(view.sent)}",
        f"   robot   {_motion(view.moving)}",
        f"   base    {view.trouble or _base(view.base, view.node)}",
    )


def _command(sent: Motion | None) -> str:
    if sent is None:
        return "nothing: others may drive"
    if not any(sent):
        return "stop"
    parts = zip((sent.x, sent.y, sent.z), ("ahead", "left", "up"), strict=True)
    named = [f"{value:+.2f} m/s {name}" for value, name in parts if value]
    return "   ".join((*named, f"{sent.yaw:+.2f} rad/s") if sent.yaw else named)


def _motion(moving: Twist | None) -> str:
    if moving is None:
        return "no odometry"
    # Adding 0 takes the sign off a zero.
    return f"{round(moving.linear.x, 2) + 0:+.2f} m/s   {round(moving.angular.z, 2) + 0:+.2f} rad/s"


def _base(base: BaseStatus | None, node: str) -> str:
    if base is None:
        return "tells nothing: is the robot still in the simulation?"
    if base.e_stopped:
        by = f" by {', '.join(base.stopped_by)}" if base.stopped_by else ""
        return f"EMERGENCY STOP{by}, until false is sent on e_stop"
    what = {"": "nobody commands it", node: "obeys these keys"}.get(base.source, f"obeys {base.source}")
    return f"{what}, touches something" if base.colliding else what


class Screen:
    """Standard output, if it is a terminal. It never blocks for long: what cannot be written is left out."""

    def __init__(self, descriptor: int = STDOUT) -> None:
        self._descriptor = descriptor
        self._shown: tuple[str, ...] = ()
        self._due = 0.0
        self._wanted = os.isatty(descriptor)

    def open(self, topic: str) -> None:
        """Print the keys."""
        if self._wanted:
            self._write(heading(topic))

    def show(self, view: View, wall: float) -> None:
        """Bring the lines up to date, at most every PERIOD_S of ``wall`` [s]."""
        if not self._wanted or wall < self._due:
            return
        self._due = wall + PERIOD_S
        width = self._width()
        drawn = tuple(line[: width - 1] for line in lines(view))
        if drawn == self._shown:
            return
        up = f"\x1b[{len(self._shown)}A" if self._shown else ""
        if self._write(up + "".join(f"\r{line}\x1b[K\n" for line in drawn)):
            self._shown = drawn

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
