"""The colours of the robots, the same wherever robots are shown: viewer, report and page.

Eight colours, then generated ones. The eight were found by a search over sRGB for the largest least distance in
OKLab, as seen with normal vision and with a lack of each of the three cones (Machado, Oliveira and Fernandes 2009):
it is a third larger than in the palette of Okabe and Ito without its yellow. Their relative luminance lies between 0.12
and 0.42, so that they can be seen on white and on a dark ground.
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
"""Share of the circle of hues between two generated colours: no two come near each other for long."""
_LIGHTNESS = (0.36, 0.5, 0.62)


class Palette:
    """Gives every name a colour and keeps it.

    The ``names`` known at first take theirs in their own order, numbers in them by value, whatever the order they come
    in: everyone who shows the robots of a fleet gives them the same colours. A name that comes later, as a robot that
    is spawned, takes the next colour, and changes nobody else's.
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        self._indices = {name: index for index, name in enumerate(sorted(set(names), key=natural_order))}

    def colour(self, name: str) -> Colour:
        """The colour of a name."""
        return colour(self._indices.setdefault(name, len(self._indices)))

    def next_colours(self, count: int) -> list[Colour]:
        """The colours that the next ``count`` names would take: those of nobody yet."""
        return [colour(len(self._indices) + index) for index in range(count)]


def colours(names: Iterable[str]) -> dict[str, Colour]:
    """A colour for each of the names; the order in which they are given makes no difference."""
    each = list(names)
    palette = Palette(each)
    return {name: palette.colour(name) for name in each}


def colour(index: int) -> Colour:
    """The colour at an index from 0 on; none repeats."""
    if index < len(COLOURS):
        return COLOURS[index]
    beyond = index - len(COLOURS)
    share = colorsys.hls_to_rgb((0.08 + beyond * _GOLDEN) % 1.0, _LIGHTNESS[beyond % len(_LIGHTNESS)], 0.6)
    red, green, blue = (round(255 * each) for each in share)
    return red, green, blue


def hexadecimal(full: Colour) -> str:
    """As CSS and Matplotlib write it: ``#578df7``."""
    return "#{:02x}{:02x}{:02x}".format(*full)


def natural_order(name: str) -> tuple[list[tuple[int, str]], str]:
    """Sorts ``tb3_2`` before ``tb3_10``."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], name
