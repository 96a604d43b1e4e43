"""Rigid transforms from external numbers: quaternions of any length and sign, in ROS 1's conventions."""

from __future__ import annotations

import math
from collections.abc import Sequence

from messages.se3 import IDENTITY, Pose3, Rotation, Vector, rotate


def rigid(translation: Sequence[float], rotation: Sequence[float]) -> Pose3:
    """Return the transform (x, y, z), (x, y, z, w); a quaternion of length 0 (empty message) is no rotation."""
    x, y, z, w = (float(each) for each in rotation)
    length = math.sqrt(x * x + y * y + z * z + w * w)
    turn = (x / length, y / length, z / length, w / length) if length > 0 else IDENTITY.orientation
    a, b, c = (float(each) for each in translation[:3])
    return Pose3((a, b, c), turn)


def transform_point(transform: Pose3, point: Sequence[float]) -> Vector:
    """Return a point of the inner frame in the outer one."""
    x, y, z = transform_vector(transform, point)
    a, b, c = transform.position
    return x + a, y + b, z + c


def transform_vector(transform: Pose3, vector: Sequence[float]) -> Vector:
    """Return a free vector of the inner frame in the axes of the outer one."""
    x, y, z = vector
    return rotate(transform.orientation, (x, y, z))


def quaternion_as_from_matrix(rotation: Rotation) -> Rotation:
    """Return the one of a rotation's two quaternions that a conversion from its matrix yields.

    As in ROS 1: the scalar part is positive if it exceeds 1/2, otherwise the largest of the others is.
    """
    lead = rotation[3] if rotation[3] * rotation[3] > 0.25 else max(rotation[:3], key=abs)
    x, y, z, w = rotation
    return rotation if lead >= 0 else (-x, -y, -z, -w)


def rotation_vector(rotation: Rotation) -> Vector:
    """Return the axis of a unit quaternion times its angle, in [0, pi] rad."""
    x, y, z, w = rotation if rotation[3] >= 0 else tuple(-each for each in rotation)
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-15:
        return 0.0, 0.0, 0.0
    share = 2 * math.atan2(sine, w) / sine
    return x * share, y * share, z * share
