"""Inertias about their principal axes, as used by physics engines."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from messages.se3 import Pose3
from models.urdf import Inertia as LinkInertia
from services.sim.physics.world import Inertia


def principal_inertia(own: LinkInertia, friction: float) -> Inertia:
    """Return the inertia of a link of a URDF about its principal axes."""
    if not any(own.tensor[3:]):
        return Inertia(own.mass, own.centre, own.tensor[:3], friction)  # type: ignore[arg-type]
    moments, axes = principal_axes(inertia_matrix(own.tensor))
    return Inertia(own.mass, own.centre @ Pose3((0.0, 0.0, 0.0), axes), moments, friction)


def inertia_matrix(tensor: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the tensor of a URDF as a matrix, shape (3, 3)."""
    xx, yy, zz, xy, xz, yz = tensor
    return np.array([(xx, xy, xz), (xy, yy, yz), (xz, yz, zz)])


def principal_axes(
    tensor: NDArray[np.float64],
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return the principal moments of an inertia, shape (3, 3), and the orientation (x, y, z, w) of its axes."""
    off = tensor - np.diag(np.diag(tensor))
    if not off.any():
        x, y, z = np.diag(tensor).tolist()
        return (x, y, z), (0.0, 0.0, 0.0, 1.0)
    moments, axes = np.linalg.eigh(tensor)
    if np.linalg.det(axes) < 0:
        axes[:, 2] = -axes[:, 2]
    a, b, c = moments.tolist()
    return (a, b, c), _quaternion(axes)


def _quaternion(axes: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the orientation whose axes are the columns of a rotation matrix."""
    r = axes
    squares = (
        1 + r[0, 0] - r[1, 1] - r[2, 2],
        1 - r[0, 0] + r[1, 1] - r[2, 2],
        1 - r[0, 0] - r[1, 1] + r[2, 2],
        1 + r[0, 0] + r[1, 1] + r[2, 2],
    )
    largest = int(np.argmax(squares))
    rows = (
        (squares[0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]),
        (r[0, 1] + r[1, 0], squares[1], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]),
        (r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[2], r[1, 0] - r[0, 1]),
        (r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], squares[3]),
    )
    x, y, z, w = (float(each) / (2 * math.sqrt(squares[largest])) for each in rows[largest])
    return x, y, z, w
