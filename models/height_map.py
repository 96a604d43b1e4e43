"""Height maps from images."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from messages.errors import BadInput
from models.bodies import HeightMapShape
from models.picture import read_picture

MAX_SAMPLES = 1025 * 1025
"""Maximum number of pixels of a height map; PyBullet takes 2 s to load as many."""


def read_heights(path: Path, height: tuple[float, float]) -> HeightMapShape:
    """Read a height map of 1 m by 1 m from an image, whose rows go from north (the top, +y) to south; raises BadInput.

    Args:
        path: The image.
        height: Height of black and of white [m].
    """
    low, high = height
    if high <= low:
        raise BadInput(f"height = [{low:g}, {high:g}] m: white must lie above black")
    lightness = read_picture(path, MAX_SAMPLES, "a height map").lightness
    if min(lightness.shape) < 2:
        raise BadInput(f"{path}: a height map has two rows and two columns at least")
    return HeightMapShape(np.ascontiguousarray(low + (high - low) * lightness[::-1]), (1.0, 1.0))
