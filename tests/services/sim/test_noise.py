"""Noise: a reading that is repeated has the same, and each robot, sensor and block its own."""

from __future__ import annotations

import numpy as np
import pytest

from services.sim.noise import BLOCK, noise_block, noise_generator


def test_a_reading_that_is_repeated_has_the_same_noise_and_others_have_their_own() -> None:
    def drawn(*key: object) -> list[float]:
        return noise_generator(*key).standard_normal(3).tolist()  # type: ignore[arg-type, no-any-return]

    first = drawn(1, "a", "scan", 40)
    assert first == drawn(1, "a", "scan", 40)
    keys = ((2, "a", "scan", 40), (1, "b", "scan", 40), (1, "a", "sonar", 40), (1, "a", "scan", 80))
    assert len({tuple(drawn(*key)) for key in keys} | {tuple(first)}) == 5


def test_blocks_are_normal_and_differ() -> None:
    block, following = noise_block(1, "a", "imu", 3, 6), noise_block(1, "a", "imu", 4, 6)
    assert block.shape == (BLOCK, 6)
    assert block.tobytes() == noise_block(1, "a", "imu", 3, 6).tobytes() != following.tobytes()
    assert np.std(block) == pytest.approx(1.0, abs=0.1)
    assert abs(np.mean(block)) < 0.1
    assert len(np.unique(np.concatenate((block, following)))) == 2 * BLOCK * 6
