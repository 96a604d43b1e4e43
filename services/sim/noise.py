"""The noise of sensors, which depends on nothing but run, robot, sensor and tick: a replayed tick gives the same."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

BLOCK = 2880
"""Numbers that are drawn at once: to seed a generator takes 30 us, as long as to draw these."""


def noise_generator(seed: int, robot: str, sensor: str, tick: int) -> np.random.Generator:
    """The random numbers of one reading."""
    return np.random.default_rng((seed, zlib.crc32(robot.encode()), zlib.crc32(sensor.encode()), tick))


class NoiseSource:
    """The noise of a sensor that is read every ``steps`` ticks, ``count`` numbers each time; drawn in blocks."""

    def __init__(self, seed: int, robot: str, sensor: str, steps: int, count: int) -> None:
        self._key, self._steps = (seed, robot, sensor), steps
        self._shape = max(1, BLOCK // count), count
        self._block, self._numbers = -1, np.empty(self._shape)

    def at(self, tick: int) -> NDArray[np.float64]:
        """The normal numbers, of deviation 1, of the reading at ``tick``, shape (count,)."""
        block, place = divmod(tick // self._steps, self._shape[0])
        if block != self._block:
            self._block, self._numbers = block, noise_generator(*self._key, block).standard_normal(self._shape)
        numbers: NDArray[np.float64] = self._numbers[place]
        return numbers
