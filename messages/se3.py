"""Rigid transforms in 3D: composition, inverse, interpolation; plain arithmetic, 2 us each.

A rotation is a unit quaternion (x, y, z, w). Where a docstring says so, components may be arrays of equal length.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from messages.geometry import Point, Pose, Quaternion, Transform, Vector3

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]

NEARLY_ONE = 0.9995
"""Cosine of half the angle between two rotations above which they are interpolated linearly: as accurate as slerp, and
safe where the sine in its denominator goes to 0."""


class Pose3(NamedTuple):
    """The pose of a frame in its parent: ``position`` [m] and ``orientation``, a unit quaternion (x, y, z, w).

    It is also the transform from the frame to its parent: a point p becomes R(orientation) p + position in the parent.
    """

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Rotation = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_msg(cls, message: Pose | Transform) -> Pose3:
        """Return the pose or transform of a message, its quaternion normalized."""
        t, q = (
            (message.position, message.orientation)
            if isinstance(message, Pose)
            else (message.translation, message.rotation)
        )
        length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
        return cls((t.x, t.y, t.z), (q.x / length, q.y / length, q.z / length, q.w / length))

    @classmethod
    def planar(cls, x: float, y: float, yaw: float = 0.0) -> Pose3:
        """Return the pose (x [m], y [m], yaw [rad]) on the ground."""
        return cls((x, y, 0.0), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))

    def to_msg(self) -> Pose:
        """Return the pose as a message."""
        (x, y, z), (i, j, k, w) = self
        return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))

    def to_transform(self) -> Transform:
        """Return the pose as a tf message."""
        (x, y, z), (i, j, k, w) = self
        return Transform(translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=i, y=j, z=k, w=w))

    @property
    def rpy(self) -> Vector:
        """Roll, pitch and yaw about the parent's fixed axes [rad], as in a URDF; at a pitch of 90 degrees roll is 0."""
        return rpy_from_quaternion(self.orientation)

    def compose(self, inner: Pose3) -> Pose3:
        """Transform ``inner`` from this frame to its parent; also written ``self @ inner``."""
        x, y, z = rotate(self.orientation, inner.position)
        return Pose3(
            (self.position[0] + x, self.position[1] + y, self.position[2] + z),
            quaternion_multiply(self.orientation, inner.orientation),
        )

    def __matmul__(self, inner: Pose3) -> Pose3:
        return self.compose(inner)

    def inverse(self) -> Pose3:
        """Return the pose of the parent in this frame: R^T, -R^T p."""
        back = quaternion_conjugate(self.orientation)
        x, y, z = rotate(back, self.position)
        return Pose3((-x, -y, -z), back)

    def interpolate(self, other: Pose3, share: float) -> Pose3:
        """Interpolate between this pose (share 0) and ``other`` (share 1): positions linearly, rotations by slerp on
        the shorter arc.

        q = (q0 sin((1 - s) a) + q1 sin(s a)) / sin a with cos a = q0 . q1 (Shoemake 1985).
        """
        position = tuple(a + share * (b - a) for a, b in zip(self.position, other.position, strict=True))
        cosine = sum(a * b for a, b in zip(self.orientation, other.orientation, strict=True))
        near, far = 1 - share, math.copysign(share, cosine)
        if abs(cosine) < NEARLY_ONE:
            angle = math.acos(abs(cosine))
            near = math.sin(near * angle) / math.sin(angle)
            far = math.copysign(math.sin(share * angle) / math.sin(angle), cosine)
        mixed = [near * a + far * b for a, b in zip(self.orientation, other.orientation, strict=True)]
        length = math.sqrt(sum(each * each for each in mixed))
        x, y, z = position
        i, j, k, w = (each / length for each in mixed)
        return Pose3((x, y, z), (i, j, k, w))


IDENTITY = Pose3()
"""The pose of a frame in itself."""


def rotate(rotation: Rotation, vector: Vector) -> Vector:
    """Rotate a vector: R(q) v = v + 2 u x (u x v + w v), u the vector part; components of ``vector`` may be arrays."""
    x, y, z, w = rotation
    a, b, c = vector
    i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return a + 2 * (y * k - z * j), b + 2 * (z * i - x * k), c + 2 * (x * j - y * i)


def rotate_inverse(rotation: Rotation, vector: Vector) -> Vector:
    """Rotate back: R(q)^T v expresses a vector of the parent in the axes of the rotated frame."""
    x, y, z, w = rotation
    return rotate((-x, -y, -z, w), vector)


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def add_cross(base: Vector, one: Vector, other: Vector) -> Vector:
    """Return ``base`` + ``one`` x ``other``, also of arrays: the velocity of a point, v + w x r, or a torque about
    another, t + r x F."""
    (x, y, z), (a, b, c), (i, j, k) = base, one, other
    return x + b * k - c * j, y + c * i - a * k, z + a * j - b * i


def rotated_axes(rotation: Rotation) -> tuple[Vector, Vector, Vector]:
    """Return the x, y and z axes of the rotated frame in its parent: the columns of the rotation matrix R(q)."""
    return rotate(rotation, (1.0, 0.0, 0.0)), rotate(rotation, (0.0, 1.0, 0.0)), rotate(rotation, (0.0, 0.0, 1.0))


def quaternion_conjugate(rotation: Rotation) -> Rotation:
    """Return the inverse rotation."""
    x, y, z, w = rotation
    return -x, -y, -z, w


def quaternion_multiply(p: Rotation, q: Rotation | tuple[Any, Any, Any, Any]) -> Rotation:
    """Return the rotation q, then p, about the parent's axes (Hamilton product); q may consist of arrays."""
    (a, b, c, w), (x, y, z, v) = p, q
    return (
        w * x + a * v + b * z - c * y,
        w * y - a * z + b * v + c * x,
        w * z + a * y - b * x + c * v,
        w * v - a * x - b * y - c * z,
    )


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Rotation:
    """Return the rotation by roll, then pitch, then yaw [rad] about fixed axes, as in a URDF: q = q_z q_y q_x."""
    cr, sr, cp, sp, cy, sy = (f(a / 2) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def rpy_from_quaternion(rotation: Rotation) -> Vector:
    """Return roll, pitch and yaw about fixed axes [rad], as in a URDF; at a pitch of 90 degrees, roll is 0."""
    x, y, z, w = rotation
    sine = 2 * (w * y - z * x)
    if abs(sine) >= 1 - 1e-12:
        return 0.0, math.copysign(math.pi / 2, sine), math.remainder(2 * math.atan2(z, w), math.tau)
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return roll, math.asin(sine), math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
