"""Samples for the plots of a page, as one binary frame that a browser reads without parsing.

Little-endian: four uint32 (the mark, the era of simulation time, how many series, 0); then for each series two uint32
(its id, how many samples), its times [s of simulation time] and its values, float64 each. Everything lies at multiples
of 8 bytes, where a browser puts typed arrays over it.
"""

from __future__ import annotations

import struct
import sys
from array import array
from collections.abc import Iterable

MARK = 0x31454C45
"""``ELE1``."""

_HEAD, _SERIES = struct.Struct("<4I"), struct.Struct("<2I")


class Samples:
    """Times and values of one series since the last frame."""

    def __init__(self) -> None:
        self.times = array("d")
        self.values = array("d")

    def add(self, time: float, value: float) -> None:
        """One sample."""
        self.times.append(time)
        self.values.append(value)

    def __len__(self) -> int:
        return len(self.times)

    def body(self) -> bytes:
        """The samples as they travel."""
        if sys.byteorder == "big":
            self.times.byteswap()
            self.values.byteswap()
        return self.times.tobytes() + self.values.tobytes()


def pack(era: int, series: Iterable[tuple[int, int, bytes]]) -> bytes:
    """A frame of series, each its id, its count of samples and its body."""
    parts = [each for id_, count, body in series for each in (_SERIES.pack(id_, count), body)]
    return b"".join((_HEAD.pack(MARK, era & 0xFFFFFFFF, len(parts) // 2, 0), *parts))
