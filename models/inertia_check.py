"""Checks whether the inertia of a link is physically possible, and plausible for its size."""

from __future__ import annotations

import math

import numpy as np

from messages.se3 import Vector
from models.mass_properties import box_inertia
from models.urdf import Inertia

FAR = 10.0
"""A moment is implausible if it differs from that of the link's bounding box by more than this factor: a hollow box
has 1.7 times the moment of a solid one, a rod in a box a third."""
ROUNDING = 1e-3
"""Relative tolerance of the triangle inequality, for values with three digits."""


def inertia_fault(inertia: Inertia) -> str:
    """Explain why no body can have this inertia; empty if it is possible.

    The mass and the principal moments must be positive and finite, and no moment may exceed the sum of the others.
    """
    if not (math.isfinite(inertia.mass) and inertia.mass > 0):
        return f"its mass of {inertia.mass:g} kg is not positive"
    if not all(map(math.isfinite, inertia.tensor)):
        return "its inertia is not finite"
    x, y, z, xy, xz, yz = inertia.tensor
    low, middle, high = np.linalg.eigvalsh(np.array(((x, xy, xz), (xy, y, yz), (xz, yz, z)))).tolist()
    shown = f"its principal moments {low:.3g}, {middle:.3g} and {high:.3g} kg m2"
    if low <= 0:
        return f"{shown} are not all positive"
    if high > (low + middle) * (1 + ROUNDING):
        return f"{shown} violate the triangle inequality: the largest exceeds the sum of the others"
    return ""


def inertia_doubt(inertia: Inertia, size: Vector) -> str:
    """Explain why an inertia is implausible for a link in a box of ``size`` [m]; empty if it is plausible.

    Its largest moment is compared with that of the homogeneous box.
    """
    box = max(box_inertia(inertia.mass, size))
    most = max(inertia.tensor[:3])
    if not box > 0 or 1 / FAR <= most / box <= FAR:
        return ""
    return (
        f"its largest moment of {most:.3g} kg m2 is x{most / box:.3g} that of a solid box of its size "
        f"({' x '.join(f'{each:.3g}' for each in size)} m, {inertia.mass:.3g} kg)"
    )
