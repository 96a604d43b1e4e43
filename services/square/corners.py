"""The square and its corners, and what a control law returns for one tick on the way around them."""

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
    """A square of ``side`` [m] to the left of ``start``, the pose on its first side; ``count`` rounds, 0 for ever."""

    start: Pose2
    side: float
    count: int = 1

    @property
    def corner_count(self) -> int | None:
        """Corners to turn at; None when there is no end."""
        return SIDES * self.count or None

    def corner(self, index: int) -> Pose2:
        """The pose that corner ``index`` asks for: where its side ends, turned along the next. -1 is the start."""
        c, s = math.cos(self.start.yaw), math.sin(self.start.yaw)
        ahead, left = ((1, 0), (1, 1), (0, 1), (0, 0))[index % SIDES]
        return Pose2(
            self.start.x + self.side * (c * ahead - s * left),
            self.start.y + self.side * (s * ahead + c * left),
            self.heading(index + 1),
        )

    def heading(self, index: int) -> float:
        """Direction of side ``index``, rad; not wrapped, but the same in every round."""
        return self.start.yaw + QUARTER_TURN * (index % SIDES)

    def segment(self, index: int) -> Segment:
        """Side ``index``, which leads to the corner of the same index."""
        begin, end = self.corner(index - 1), self.corner(index)
        return Segment(begin.x, begin.y, end.x, end.y)

    def corners(self) -> tuple[Pose2, ...]:
        """All corners in order; those of one round when there is no end."""
        return tuple(self.corner(index) for index in range(self.corner_count or SIDES))


State = Literal["waiting", "driving", "reached", "finished"]


@dataclass(frozen=True, slots=True)
class StepResult:
    """The command, None where the law has none to send; the corner pursued; and the pose that it should have now.

    ``doing`` is the law's own word for it, as the log shows it. ``late`` tells that the robot leaves the corner without
    having met it within the tolerances.
    """

    state: State
    command: Twist2 | None
    index: int
    desired: Pose2
    phase: str
    timed_out: bool = False
