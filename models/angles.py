"""Angles in files [rad], and the error for one that was probably written in degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta

from models.toml_source import TomlKey

MAX_ANGLE = 6.3
"""Maximum angle [rad]: a full turn, also if rounded up. Beyond it, values such as 90 and 180 are degrees."""
Angle = Annotated[float, Meta(ge=-MAX_ANGLE, le=MAX_ANGLE, extra={"unit": "rad"})]
_KEYS = {"yaw", "rpy"}


def angle_fault(value: object, path: Sequence[TomlKey] = ("yaw",)) -> str:
    """Explain what is wrong with the angle at ``path`` of a file; empty if nothing is, or if it is not an angle."""
    if not isinstance(value, int | float) or not math.isfinite(value) or abs(value) <= MAX_ANGLE:
        return ""
    if not _KEYS.intersection(path[-2:]):
        return ""
    return (
        f"{value:g} rad is more than a whole turn, 6.28: angles are in rad, so write {math.radians(value):.4f} "
        f"for {value:g} degrees"
    )
