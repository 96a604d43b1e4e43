"""Noise: a repeated reading has the same, and each robot, sensor and reading has its own."""

from __future__ import annotations

import numpy as np
import pytest

from services.sim.noise import BLOCK, NoiseSource


def test_a_reading_that_is_repeated_has_the_same_noise_and_others_have_their_own() -> None:
    source = NoiseSource(1, "a", "scan", 40, 3)
    readings = [source.at(tick).tolist() for tick in range(0, 80 * BLOCK, 40)]
    assert len(set(map(tuple, readings))) == len(readings), "also beyond a block"
    again = NoiseSource(1, "a", "scan", 40, 3)
    for reading in (2 * BLOCK - 1, 1, BLOCK, 0):
        assert again.at(40 * reading).tolist() == source.at(40 * reading).tolist() == readings[reading]
    for key in ((2, "a", "scan"), (1, "b", "scan"), (1, "a", "sonar")):
        assert NoiseSource(*key, 40, 3).at(40).tolist() not in readings


def test_noise_is_normal_however_many_numbers_a_reading_has() -> None:
    for count in (1, 6, 360, 3 * BLOCK):
        source = NoiseSource(1, "a", "scan", 2, count)
        drawn = np.concatenate([source.at(2 * reading) for reading in range(max(2, 4 * BLOCK // count))])
        assert np.std(drawn) == pytest.approx(1.0, abs=0.05)
        assert abs(np.mean(drawn)) < 0.05
        assert len(np.unique(drawn)) == len(drawn)
