"""Records of a trajectory: a fingerprint of all samples, and a thinned trail for the picture."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping

from messages.geometry import Pose

_SAMPLE = struct.Struct("<q7d")
_JOINT = struct.Struct("<q2d")

TRAIL_LENGTH = 6000
"""Maximum number of points of a trail; five minutes at 50 Hz are thinned to 3750."""


class Fingerprint:
    """SHA-256 over the samples of one robot in stamp order.

    Each sample is its stamp [ns] as int64 and doubles: x y z qx qy qz qw of a base, angle and rate of an arm's joint.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, stamp: int, pose: Pose) -> None:
        """Add one sample; ``stamp`` in ns."""
        p, q = pose.position, pose.orientation
        self._hash.update(_SAMPLE.pack(stamp, p.x, p.y, p.z, q.x, q.y, q.z, q.w))

    def add_joint(self, stamp: int, angle: float, rate: float) -> None:
        """Add one sample of an arm: stamp [ns], angle [rad], rate [rad/s]."""
        self._hash.update(_JOINT.pack(stamp, angle, rate))

    def digest(self) -> bytes:
        """Return the SHA-256 digest of the samples so far, 32 bytes."""
        return self._hash.digest()


def trajectory_hash(fingerprints: Mapping[str, Fingerprint]) -> str:
    """Return one hexadecimal hash over all robots, in the order of their names."""
    combined = hashlib.sha256()
    for name in sorted(fingerprints):
        combined.update(name.encode() + b"\0" + fingerprints[name].digest())
    return combined.hexdigest()


class Trail:
    """Evenly thinned rows: when full, every second row is dropped, and from then on only every second one is added."""

    def __init__(self, length: int = TRAIL_LENGTH) -> None:
        self.rows: list[tuple[float, ...]] = []
        self._length, self._stride, self._seen = length, 1, 0

    def add(self, row: tuple[float, ...]) -> None:
        """Add the next row, unless it is thinned out."""
        if self._seen % self._stride == 0:
            if len(self.rows) >= self._length:
                self.rows = self.rows[::2]
                self._stride *= 2
            if self._seen % self._stride == 0:
                self.rows.append(row)
        self._seen += 1
