"""The drawn plane as pixels, for the turtles' colour sensors."""

from __future__ import annotations

import math

import numpy as np

from messages.turtlesim import Color
from services.turtlesim.turtle import PIXELS_PER_METRE, WINDOW_PIXELS

Point = tuple[float, float]


class Canvas:
    """A picture of the plane, as large as ROS's window. Points are in m from the lower left corner."""

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
        """The colour of a point."""
        column, row = (min(max(round(each), 0), WINDOW_PIXELS - 1) for each in _pixel(point))
        red, green, blue = self._pixels[row, column].tolist()
        return Color(r=red, g=green, b=blue)


def _pixel(point: Point) -> Point:
    """Column and row of a point; rows count downwards."""
    x, y = point
    return x * PIXELS_PER_METRE, WINDOW_PIXELS - 1 - y * PIXELS_PER_METRE


def _span(one: float, other: float, reach: float) -> tuple[int, int]:
    """The pixels, from the first to behind the last, within ``reach`` of both ends."""
    low, high = sorted((one, other))
    return max(0, math.floor(low - reach)), min(WINDOW_PIXELS, math.ceil(high + reach) + 1)
