"""Static transforms that the logger needs: of odometry frames and lasers."""

from __future__ import annotations

from messages.se2 import Pose2
from messages.se3 import IDENTITY, Pose3
from services.runtime.errors import NoTransform
from services.runtime.tf.buffer import WORLD, TransformBuffer


def world_transform(frames: TransformBuffer, frame: str) -> Pose2 | None:
    """Return the planar pose of a frame in the world; None if ``/tf_static`` does not have it."""
    if frame in ("", WORLD):
        return Pose2()
    if (found := mount_transform(frames, WORLD, frame)) is None:
        return None
    return Pose2(found.position[0], found.position[1], found.rpy[2])


def mount_transform(frames: TransformBuffer, base: str, frame: str) -> Pose3 | None:
    """Return the pose of a frame in ``base``; None if ``/tf_static`` does not have it."""
    if base == frame:
        return IDENTITY
    try:
        found = frames.lookup(base, frame)
    except NoTransform:
        return None
    return found.transform if found.time is None else None
