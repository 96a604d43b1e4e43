"""Rigid transforms in three dimensions: composed, inverted, interpolated; plain arithmetic, 2 us each."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.geometry import Quaternion, Transform, Vector3

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]

NEARLY_ONE = 0.9995
"""Cosine of half the angle between two rotations above which a straight line is as good as an arc, and safer: the
sine in the arc's denominator goes to 0."""


class SE3(NamedTuple):
    """Where a child frame lies in its parent: ``place`` [m] and ``turn``, a unit quaternion (x, y, z, w).

    A point p of the child is R(turn) p + place in the parent.
    """

    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Rotation = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_msg(cls, transform: Transform) -> SE3:
        """The transform of a message, its rotation taken at length 1."""
        t, q = transform.translation, transform.rotation
        length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
        return cls((t.x, t.y, t.z), (q.x / length, q.y / length, q.z / length, q.w / length))

    @property
    def to_msg(self) -> Transform:
        """As it travels."""
        (x, y, z), (i, j, k, w) = self
        return Transform(translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=i, y=j, z=k, w=w))

    @property
    def rpy(self) -> Vector:
        """Roll, pitch and yaw about the parent's fixed axes [rad], as in a URDF; at a pitch of 90 degrees roll is 0."""
        x, y, z, w = self.rotation
        sine = 2 * (w * y - z * x)
        if abs(sine) >= 1 - 1e-12:
            return 0.0, math.copysign(math.pi / 2, sine), math.remainder(2 * math.atan2(z, w), math.tau)
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        return roll, math.asin(sine), math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def compose(self, inner: SE3) -> SE3:
        """The frame ``inner``, told in this one's frame, told in this one's parent: T = self inner."""
        x, y, z = rotate(self.rotation, inner.translation)
        return SE3(
            (self.translation[0] + x, self.translation[1] + y, self.translation[2] + z),
            quaternion_multiply(self.rotation, inner.rotation),
        )

    def inverse(self) -> SE3:
        """The parent told in the child: R^T, -R^T p."""
        i, j, k, w = self.rotation
        back = (-i, -j, -k, w)
        x, y, z = rotate(back, self.translation)
        return SE3((-x, -y, -z), back)

    def interpolate(self, other: SE3, share: float) -> SE3:
        """Between this (share 0) and ``other`` (share 1): places on a line, rotations on the shorter arc (slerp).

        q = (q0 sin((1 - s) a) + q1 sin(s a)) / sin a with cos a = q0 . q1 (Shoemake 1985).
        """
        place = tuple(a + share * (b - a) for a, b in zip(self.translation, other.translation, strict=True))
        cosine = sum(a * b for a, b in zip(self.rotation, other.rotation, strict=True))
        near, far = 1 - share, math.copysign(share, cosine)
        if abs(cosine) < NEARLY_ONE:
            angle = math.acos(abs(cosine))
            near = math.sin(near * angle) / math.sin(angle)
            far = math.copysign(math.sin(share * angle) / math.sin(angle), cosine)
        turn = [near * a + far * b for a, b in zip(self.rotation, other.rotation, strict=True)]
        length = math.sqrt(sum(each * each for each in turn))
        x, y, z = place
        i, j, k, w = (each / length for each in turn)
        return SE3((x, y, z), (i, j, k, w))


IDENTITY = SE3()
"""A frame told in itself."""


def rotate(turn: Rotation, vector: Vector) -> Vector:
    """R(turn) v = v + 2 u x (u x v + w v), with u the vector part."""
    x, y, z, w = turn
    a, b, c = vector
    i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return a + 2 * (y * k - z * j), b + 2 * (z * i - x * k), c + 2 * (x * j - y * i)


def quaternion_multiply(p: Rotation, q: Rotation) -> Rotation:
    """The rotation q, then p, each about the axes of the parent (Hamilton's product)."""
    (a, b, c, w), (x, y, z, v) = p, q
    return (
        w * x + a * v + b * z - c * y,
        w * y - a * z + b * v + c * x,
        w * z + a * y - b * x + c * v,
        w * v - a * x - b * y - c * z,
    )
