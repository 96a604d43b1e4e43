"""The colours of the robots, the same wherever robots are displayed: viewer, report and panel.

Eight colours, then generated ones. The eight were found by a search over sRGB for the largest minimum distance in
OKLab, for normal vision and for each of the three colour deficiencies (Machado, Oliveira and Fernandes 2009): it is a
third larger than in the palette of Okabe and Ito without its yellow. Their relative luminance is between 0.12 and 0.42,
so that they are visible on white and on dark backgrounds.
"""

from __future__ import annotations

import colorsys
import re
from collections.abc import Iterable

Colour = tuple[int, int, int]
"""Red, green and blue in sRGB, 0 to 255."""

COLOURS: tuple[Colour, ...] = (
    (0x57, 0x8D, 0xF7),
    (0xCE, 0x6C, 0x0B),
    (0x72, 0x93, 0x72),
    (0xB0, 0x62, 0xB0),
    (0x00, 0xBE, 0xD5),
    (0xC1, 0x0F, 0x27),
    (0xC4, 0xAC, 0x26),
    (0x7E, 0x3C, 0xC7),
)
"""Blue, orange, green, purple, cyan, red, yellow, violet."""

_GOLDEN = 0.6180339887498949
"""Share of the hue circle between two generated colours, so that successive hues stay far apart."""
_LIGHTNESS = (0.36, 0.5, 0.62)


class Palette:
    """Assigns a permanent colour to every name.

    The initial ``names`` get theirs in natural order, numbers in them by value, whatever the order they are passed in,
    so that every viewer of a fleet uses the same colours. A name added later, e.g. a spawned robot, gets the next
    colour and changes no other.
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        self._indices = {name: index for index, name in enumerate(sorted(set(names), key=natural_order))}

    def colour(self, name: str) -> Colour:
        """Return the colour of a name."""
        return colour(self._indices.setdefault(name, len(self._indices)))

    def next_colours(self, count: int) -> list[Colour]:
        """Return the colours that the next ``count`` new names would get."""
        return [colour(len(self._indices) + index) for index in range(count)]


def colours(names: Iterable[str]) -> dict[str, Colour]:
    """Assign a colour to each of the names, whatever their order."""
    each = list(names)
    palette = Palette(each)
    return {name: palette.colour(name) for name in each}


def colour(index: int) -> Colour:
    """Return the colour at an index, from 0 on; none repeats."""
    if index < len(COLOURS):
        return COLOURS[index]
    beyond = index - len(COLOURS)
    share = colorsys.hls_to_rgb((0.08 + beyond * _GOLDEN) % 1.0, _LIGHTNESS[beyond % len(_LIGHTNESS)], 0.6)
    red, green, blue = (round(255 * each) for each in share)
    return red, green, blue


def hexadecimal(full: Colour) -> str:
    """Format as in CSS and Matplotlib: ``#578df7``."""
    return "#{:02x}{:02x}{:02x}".format(*full)


def natural_order(name: str) -> tuple[list[tuple[int, str]], str]:
    """Sort key that puts ``tb3_2`` before ``tb3_10``."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], name
