"""The colours of the robots: told apart on a dark ground, also by the colour-blind."""

from __future__ import annotations

Colour = tuple[int, int, int]

COLOURS: tuple[Colour, ...] = (
    (255, 159, 28),
    (76, 201, 240),
    (120, 220, 110),
    (247, 120, 190),
    (250, 230, 90),
    (150, 140, 255),
)
"""After the palette of Okabe and Ito (Color Universal Design, 2008), lightened for a dark ground."""


def colour(index: int) -> Colour:
    """The colour of the robot at ``index``; they repeat after the last."""
    return COLOURS[index % len(COLOURS)]


def pale(full: Colour) -> Colour:
    """Halfway to white, for what a robot believes or sees."""
    red, green, blue = full
    return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2


def dimmed(full: Colour) -> Colour:
    """A darker shade of a colour, for what is wanted rather than what is."""
    red, green, blue = full
    return red * 5 // 9, green * 5 // 9, blue * 5 // 9
