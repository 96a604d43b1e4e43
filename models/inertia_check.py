"""Checks the inertia of a link: whether a body can have it, and one of this size."""

from __future__ import annotations

import math

import numpy as np

from messages.se3 import Vector
from models.extents import box_inertia
from models.urdf import Inertia

FAR = 10.0
"""Factor between a moment and that of the box around the link from which on it is doubtful: a hollow box has 1.7 times
that of a full one, a rod within a box a third."""
ROUNDING = 1e-3
"""Share by which the triangle inequality may be missed, as by figures with three digits."""


def inertia_fault(inertia: Inertia) -> str:
    """Why no body can have this inertia; empty if one can.

    The mass and the principal moments are positive and finite, and none of the moments exceeds the sum of the others.
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
    """Why an inertia is unlikely for a link in a box of ``size`` [m]; empty if it is not.

    The moments are compared with those of the homogeneous box, the largest with the largest.
    """
    box = max(box_inertia(inertia.mass, size))
    most = max(inertia.tensor[:3])
    if not box > 0 or 1 / FAR <= most / box <= FAR:
        return ""
    return (
        f"its largest moment of {most:.3g} kg m2 is x{most / box:.3g} that of a full box of its size "
        f"({' x '.join(f'{each:.3g}' for each in size)} m, {inertia.mass:.3g} kg)"
    )
