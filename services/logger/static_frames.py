"""Static transforms that the logger needs: of odometry frames and lasers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from messages.se2 import Pose2
from messages.se3 import IDENTITY, Pose3
from services.runtime.errors import NoTransform
from services.runtime.tf.buffer import TransformBuffer

Floats = NDArray[np.float64]


WORLD = "world"


def world_transform(frames: TransformBuffer, frame: str) -> Pose2 | None:
    """Return the planar pose of a frame in the world; None if ``/tf_static`` does not have it."""
    if frame in ("", WORLD):
        return Pose2()
    if (found := mount_transform(frames, WORLD, frame)) is None:
        return None
    return Pose2(found.position[0], found.position[1], found.rpy[2])


def transform_points(transform: Pose2, points: Floats) -> Floats:
    """Transform points of shape (n, 2) [m] from a frame with the pose ``transform`` to its parent."""
    c, s = math.cos(transform.yaw), math.sin(transform.yaw)
    x, y = points[:, 0], points[:, 1]
    return np.column_stack((c * x - s * y + transform.x, s * x + c * y + transform.y))


def mount_transform(frames: TransformBuffer, base: str, frame: str) -> Pose3 | None:
    """Return the pose of a frame in ``base``; None if ``/tf_static`` does not have it."""
    if base == frame:
        return IDENTITY
    try:
        found = frames.lookup(base, frame)
    except NoTransform:
        return None
    return found.transform if found.time is None else None
