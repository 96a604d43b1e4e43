"""The trails of the turtles' pens: polylines with few points for viewers, pixels for the turtles' colour sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from messages.turtlesim import Color
from services.turtlesim.turtle import PIXELS_PER_METRE, WINDOW_PIXELS

Point = tuple[float, float]

TOLERANCE_M = 0.005
"""Maximum distance [m] of a drawn line from the turtle's path; a quarter of a pixel of ROS's window."""
MAX_POINTS = 200
"""Maximum number of points of a line; the trail continues in another one. A line that has grown is sent whole."""
MAX_PENDING = 100
"""Maximum number of positions that one straight part of a line replaces."""
MAX_LINES = 2000
"""Maximum number of lines; beyond it, the oldest are dropped."""


@dataclass
class Line:
    """A line of one colour and width [pixels], with a unique number; ``points`` in m.

    ``pending`` are the positions since the last point but one. The last point moves along while the turtle goes
    straight. ``changed`` marks a line that viewers have not received in its current state.
    """

    number: int
    turtle: str
    colour: Color
    width: int
    points: list[Point]
    pending: list[Point] = field(default_factory=list)
    changed: bool = True

    def fits(self, end: Point) -> bool:
        """Whether all positions since the last point but one lie on the straight line from there to ``end``."""
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
        """Whether the line is full and ``end`` would need another point."""
        return len(self.points) >= MAX_POINTS and not self.fits(end)

    def extend(self, end: Point) -> None:
        """Extend the line to ``end``."""
        if self.fits(end):
            self.points[-1] = end
        else:
            self.points.append(end)
            self.pending = []
        self.pending.append(end)
        self.changed = True


class Trails:
    """The lines of all turtles, in order of creation."""

    def __init__(self) -> None:
        self.lines: dict[int, Line] = {}
        self._drawn: dict[str, Line] = {}
        """The current line of each turtle."""
        self._count = 0

    def lift(self, turtle: str) -> None:
        """End a turtle's line."""
        self._drawn.pop(turtle, None)

    def clear(self) -> None:
        """Remove all lines."""
        self.lines, self._drawn = {}, {}

    def draw(self, turtle: str, start: Point, end: Point, colour: Color, width: int) -> None:
        """Draw from the turtle's previous to its current position."""
        line = self._drawn.get(turtle)
        if line is None or (line.colour, line.width, line.points[-1]) != (colour, width, start) or line.full_for(end):
            line = self._begin(turtle, start, colour, width)
        line.extend(end)

    def _begin(self, turtle: str, start: Point, colour: Color, width: int) -> Line:
        self._count += 1
        line = self._drawn[turtle] = self.lines[self._count] = Line(self._count, turtle, colour, width, [start])
        if len(self.lines) > MAX_LINES:
            dropped = self.lines.pop(next(iter(self.lines)))
            if self._drawn.get(dropped.turtle) is dropped:
                del self._drawn[dropped.turtle]
        return line


class Canvas:
    """An image of the plane, as large as ROS's window. Points are in m from the lower left corner."""

    def __init__(self, background: Color) -> None:
        self._pixels = np.empty((WINDOW_PIXELS, WINDOW_PIXELS, 3), np.uint8)
        self.clear(background)

    def clear(self, background: Color) -> None:
        """Paint the whole plane."""
        self._pixels[:] = background.r, background.g, background.b

    def draw(self, start: Point, end: Point, colour: Color, width: float) -> None:
        """Draw a line with round ends, ``width`` in pixels."""
        (x0, y0), (x1, y1) = _pixel(start), _pixel(end)
        reach = max(width, 1.0) / 2
        left, right = _span(x0, x1, reach)
        top, bottom = _span(y0, y1, reach)
        rows, columns = np.mgrid[top:bottom, left:right]
        ux, uy = x1 - x0, y1 - y0
        square = ux * ux + uy * uy
        along = np.clip(((columns - x0) * ux + (rows - y0) * uy) / square, 0.0, 1.0) if square else 0.0
        distance = np.hypot(columns - x0 - along * ux, rows - y0 - along * uy)
        self._pixels[top:bottom, left:right][distance <= reach] = colour.r, colour.g, colour.b

    def colour_at(self, point: Point) -> Color:
        """Return the colour at a point."""
        column, row = (min(max(round(each), 0), WINDOW_PIXELS - 1) for each in _pixel(point))
        red, green, blue = self._pixels[row, column].tolist()
        return Color(r=red, g=green, b=blue)


def _pixel(point: Point) -> Point:
    """Return column and row of a point; rows count downwards."""
    x, y = point
    return x * PIXELS_PER_METRE, WINDOW_PIXELS - 1 - y * PIXELS_PER_METRE


def _span(one: float, other: float, reach: float) -> tuple[int, int]:
    """Return the pixel range, first to one past the last, within ``reach`` of both ends."""
    low, high = sorted((one, other))
    return max(0, math.floor(low - reach)), min(WINDOW_PIXELS, math.ceil(high + reach) + 1)
