"""The noise of sensors, which depends on nothing but run, robot, sensor and tick: a replayed tick gives the same."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

BLOCK = 128
"""Readings of a fast sensor whose noise is drawn at once: a generator takes 30 us to seed, and six numbers take 0.1."""


def noise_generator(seed: int, robot: str, sensor: str, tick: int) -> np.random.Generator:
    """The random numbers of one reading."""
    return np.random.default_rng((seed, zlib.crc32(robot.encode()), zlib.crc32(sensor.encode()), tick))


def noise_block(seed: int, robot: str, sensor: str, block: int, count: int) -> NDArray[np.float64]:
    """Normal numbers with deviation 1 for the readings from ``block * BLOCK`` on, shape (BLOCK, count)."""
    return noise_generator(seed, robot, sensor, block).standard_normal((BLOCK, count))
