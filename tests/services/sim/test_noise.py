"""Noise: generators that are seeded in blocks are those that numpy makes one by one."""

from __future__ import annotations

from services.sim.noise import BLOCK, NoiseSource, noise_generator


def test_a_block_of_generators_is_numpy_s_own() -> None:
    for seed in (0, 3, 2**32 - 1, 2**32, 2**70 + 5):
        for steps in (2, 40):
            source = NoiseSource(seed, "tb3_0", "imu", steps)
            for tick in (0, steps, (BLOCK - 1) * steps, BLOCK * steps, 10**6 * steps, 3 * steps):
                expected = noise_generator(seed, "tb3_0", "imu", tick)
                made = source.at(tick)
                assert made.standard_normal(6).tolist() == expected.standard_normal(6).tolist(), (seed, steps, tick)
                assert made.normal(0.0, 0.01, 5).tolist() == expected.normal(0.0, 0.01, 5).tolist()


def test_a_reading_that_is_repeated_has_the_same_noise_and_others_have_their_own() -> None:
    source, other = NoiseSource(1, "a", "scan", 40), NoiseSource(1, "b", "scan", 40)
    first = source.at(40).standard_normal(3).tolist()
    assert source.at(80).standard_normal(3).tolist() != first
    assert source.at(40).standard_normal(3).tolist() == first
    assert other.at(40).standard_normal(3).tolist() != first
