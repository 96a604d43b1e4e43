"""The square with its corners, and the result of one tick of a control law."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from messages.se2 import Pose2, Twist2
from services.driving.guidance import Segment

SIDES = 4
QUARTER_TURN = math.pi / 2


@dataclass(frozen=True, slots=True)
class Square:
    """A square of ``side`` [m] to the left of the pose ``start``, driven ``count`` times; 0 for endless."""

    start: Pose2
    side: float
    count: int = 1

    @property
    def corner_count(self) -> int | None:
        """Total number of corners; None if endless."""
        return SIDES * self.count or None

    def corner(self, index: int) -> Pose2:
        """Return the target pose at corner ``index``: the end of its side, heading along the next. -1 is the start."""
        c, s = math.cos(self.start.yaw), math.sin(self.start.yaw)
        ahead, left = ((1, 0), (1, 1), (0, 1), (0, 0))[index % SIDES]
        return Pose2(
            self.start.x + self.side * (c * ahead - s * left),
            self.start.y + self.side * (s * ahead + c * left),
            self.heading(index + 1),
        )

    def heading(self, index: int) -> float:
        """Return the direction of side ``index`` [rad]; not wrapped, but the same in each round."""
        return self.start.yaw + QUARTER_TURN * (index % SIDES)

    def segment(self, index: int) -> Segment:
        """Return side ``index``, which leads to the corner with the same index."""
        begin, end = self.corner(index - 1), self.corner(index)
        return Segment(begin.x, begin.y, end.x, end.y)

    def corners(self) -> tuple[Pose2, ...]:
        """Return all corners in order; those of one round if endless."""
        return tuple(self.corner(index) for index in range(self.corner_count or SIDES))


State = Literal["waiting", "driving", "reached", "finished"]


@dataclass(frozen=True, slots=True)
class StepResult:
    """Result of one tick of a control law.

    Attributes:
        state: Progress, as in the status message.
        command: Command to send; None for no command.
        index: Index of the corner that the robot drives to.
        desired: Pose that the robot should have now.
        phase: The law's own name of its state, as logged.
        timed_out: The robot leaves the corner without having met the tolerances.
    """

    state: State
    command: Twist2 | None
    index: int
    desired: Pose2
    phase: str
    timed_out: bool = False
