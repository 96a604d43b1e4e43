"""Sensor noise, a function of run, robot, sensor and tick alone, so that a replayed tick gives the same numbers."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

BLOCK = 2880
"""Numbers drawn at once: seeding a generator takes 30 us, as long as drawing these."""


def noise_generator(seed: int, robot: str, sensor: str, tick: int) -> np.random.Generator:
    """Return the random generator of one reading, or of one block of readings."""
    return np.random.default_rng((seed, zlib.crc32(robot.encode()), zlib.crc32(sensor.encode()), tick))


class NoiseSource:
    """The noise of a sensor read every ``steps`` ticks, ``count`` numbers each time; drawn in blocks."""

    def __init__(self, seed: int, robot: str, sensor: str, steps: int, count: int) -> None:
        self._key, self._steps = (seed, robot, sensor), steps
        self._shape = max(1, BLOCK // count), count
        self._drawn, self._numbers = -1, np.empty(self._shape)

    def at(self, tick: int) -> NDArray[np.float64]:
        """Return standard normal numbers for the reading at ``tick``, shape (count,)."""
        block, index = self.locate(tick)
        if block != self._drawn:
            self._drawn, self._numbers = block, self.block(block)
        numbers: NDArray[np.float64] = self._numbers[index]
        return numbers

    def locate(self, tick: int) -> tuple[int, int]:
        """Return the block of the reading at ``tick`` and its index there; sources of one rate and count agree."""
        return divmod(tick // self._steps, self._shape[0])

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the numbers of a block, shape (readings, count)."""
        return noise_generator(*self._key, number).standard_normal(self._shape)
