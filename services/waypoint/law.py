"""The law of the seed, proportional and without limits; that of the steady one is in ``steady.py``."""

from __future__ import annotations

import math

from services.motion.planar import Motion, Planar, wrap

SEED_SWITCH = 0.3
"""Distance [m] at which the seed turns to its next point."""
SEED_LINEAR = 0.1
"""Speed per distance of the seed, 1/s."""
SEED_ANGULAR = 0.7
"""Turn rate per heading error of the seed, 1/s."""


def seed(here: Planar, x: float, y: float) -> Motion:
    """The seed's command towards (x, y): v = 0.1 D, w = 0.7 e, whatever the heading and without any limit.

    Its eight-way case distinction is atan2, except that it keeps the last bearing when it stands exactly on the point.
    """
    dx, dy = x - here.x, y - here.y
    return Motion(SEED_LINEAR * math.hypot(dx, dy), SEED_ANGULAR * wrap(math.atan2(dy, dx) - here.yaw))
