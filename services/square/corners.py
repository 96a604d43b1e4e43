"""The square: its corners, counted from the pose at which the robot began."""

from __future__ import annotations

import math
from dataclasses import dataclass

from services.motion.planar import Leg, Planar

SIDES = 4
QUARTER = math.pi / 2


@dataclass(frozen=True, slots=True)
class Square:
    """A square of ``side`` [m] to the left of ``start``, the pose on its first side; ``count`` rounds, 0 for ever."""

    start: Planar
    side: float
    count: int = 1

    @property
    def turns(self) -> int | None:
        """Corners to turn at; None when there is no end."""
        return SIDES * self.count or None

    def corner(self, index: int) -> Planar:
        """The pose that corner ``index`` asks for: where its side ends, turned along the next. -1 is the start."""
        c, s = math.cos(self.start.yaw), math.sin(self.start.yaw)
        ahead, left = ((1, 0), (1, 1), (0, 1), (0, 0))[index % SIDES]
        return Planar(
            self.start.x + self.side * (c * ahead - s * left),
            self.start.y + self.side * (s * ahead + c * left),
            self.heading(index + 1),
        )

    def heading(self, index: int) -> float:
        """Direction of side ``index``, rad; not wrapped, but the same in every round."""
        return self.start.yaw + QUARTER * (index % SIDES)

    def leg(self, index: int) -> Leg:
        """Side ``index``, which leads to the corner of the same index."""
        begin, end = self.corner(index - 1), self.corner(index)
        return Leg(begin.x, begin.y, end.x, end.y)

    def corners(self) -> tuple[Planar, ...]:
        """All corners in order; those of one round when there is no end."""
        return tuple(self.corner(index) for index in range(self.turns or SIDES))
