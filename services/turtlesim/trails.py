"""What the turtles' pens have drawn: lines of few points, for viewers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from messages.turtlesim import Color

Point = tuple[float, float]

TOLERANCE_M = 0.005
"""Distance [m] of a drawn line from the turtle's way; a quarter of a pixel of ROS's window."""
MAX_POINTS = 200
"""Points of a line; the trail goes on in another one. A line that has grown is sent whole."""
MAX_PENDING = 100
"""Positions that one straight part of a line stands for at most."""
MAX_LINES = 2000
"""Lines that are kept; beyond, the oldest are forgotten."""


@dataclass
class Line:
    """A line of one colour and width [pixels], with a number of its own; ``points`` in m.

    ``pending`` are the positions since the last point but one. The last point moves along while the turtle goes
    straight. ``changed`` says that viewers do not have it as it is.
    """

    number: int
    turtle: str
    colour: Color
    width: int
    points: list[Point]
    pending: list[Point] = field(default_factory=list)
    changed: bool = True

    def fits(self, end: Point) -> bool:
        """Whether all positions since the last point but one lie on the straight way from there to ``end``."""
        if len(self.points) < 2 or len(self.pending) >= MAX_PENDING:
            return False
        start = self.points[-2]
        ux, uy = end[0] - start[0], end[1] - start[1]
        length = math.hypot(ux, uy)
        for x, y in self.pending:
            dx, dy = x - start[0], y - start[1]
            ahead = dx * ux + dy * uy
            if ahead < 0 or ahead > length * length or abs(dx * uy - dy * ux) > TOLERANCE_M * length:
                return False
        return True

    def full_for(self, end: Point) -> bool:
        """Whether ``end`` would be a point too many."""
        return len(self.points) >= MAX_POINTS and not self.fits(end)

    def extend(self, end: Point) -> None:
        """Draw on to ``end``."""
        if self.fits(end):
            self.points[-1] = end
        else:
            self.points.append(end)
            self.pending = []
        self.pending.append(end)
        self.changed = True


class Trails:
    """The lines of all turtles, in the order in which they were begun."""

    def __init__(self) -> None:
        self.lines: dict[int, Line] = {}
        self._drawn: dict[str, Line] = {}
        """By turtle, the line that it draws."""
        self._count = 0

    def lift(self, turtle: str) -> None:
        """End a turtle's line."""
        self._drawn.pop(turtle, None)

    def clear(self) -> None:
        """Forget all lines."""
        self.lines, self._drawn = {}, {}

    def draw(self, turtle: str, start: Point, end: Point, colour: Color, width: int) -> None:
        """Draw from where a turtle was to where it is."""
        line = self._drawn.get(turtle)
        if line is None or (line.colour, line.width, line.points[-1]) != (colour, width, start) or line.full_for(end):
            line = self._begin(turtle, start, colour, width)
        line.extend(end)

    def _begin(self, turtle: str, start: Point, colour: Color, width: int) -> Line:
        self._count += 1
        line = self._drawn[turtle] = self.lines[self._count] = Line(self._count, turtle, colour, width, [start])
        if len(self.lines) > MAX_LINES:
            del self.lines[next(iter(self.lines))]
        return line
