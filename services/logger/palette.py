"""Shades of a robot's colour in the viewer."""

from __future__ import annotations

from models.palette import Colour


def pale(full: Colour) -> Colour:
    """Halfway to white, for what a robot believes or sees."""
    red, green, blue = full
    return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2


def dimmed(full: Colour) -> Colour:
    """A darker shade of a colour, for what is wanted rather than what is."""
    red, green, blue = full
    return red * 5 // 9, green * 5 // 9, blue * 5 // 9
