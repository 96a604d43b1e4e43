"""The noise of sensors, which depends on nothing but run, robot, sensor and tick: a replayed tick gives the same."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BLOCK = 128
"""Readings whose generators are seeded at once: a block takes 0.2 ms, and each generator by itself 0.03."""

_MASK32, _MASK128 = (1 << 32) - 1, (1 << 128) - 1
_HASH_A, _HASH_B = (0x43B0D7E5, 0x931E8875), (0x8B51F9DD, 0x58F38DED)
_MIX_LEFT, _MIX_RIGHT, _SHIFT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715), np.uint32(16)
_PCG64_FACTOR = 0x2360ED051FC65DA44385DF649FCCF645

Words = NDArray[np.uint32]


def noise_generator(seed: int, robot: str, sensor: str, tick: int) -> np.random.Generator:
    """The random numbers of one reading."""
    return np.random.default_rng((*_words(seed, robot, sensor), tick))


class NoiseSource:
    """The generators of a sensor's readings, one every ``steps`` ticks, each the same as ``noise_generator`` makes."""

    def __init__(self, seed: int, robot: str, sensor: str, steps: int) -> None:
        self._words, self._steps = _words(seed, robot, sensor), steps
        self._bits = np.random.PCG64(0)
        self._generator = np.random.Generator(self._bits)
        self._block: dict[int, tuple[int, int]] = {}

    def at(self, tick: int) -> np.random.Generator:
        """The generator of the reading at ``tick``; good until the next call."""
        if (seeded := self._block.get(tick)) is None:
            ticks = range(tick, tick + BLOCK * self._steps, self._steps)
            self._block = dict(zip(ticks, pcg64_states((*self._words, np.array(ticks))), strict=True))
            seeded = self._block[tick]
        state, increment = seeded
        self._bits.state = {
            "bit_generator": "PCG64",
            "state": {"state": state, "inc": increment},
            "has_uint32": 0,
            "uinteger": 0,
        }
        return self._generator


def _words(seed: int, robot: str, sensor: str) -> tuple[int, int, int]:
    return seed, zlib.crc32(robot.encode()), zlib.crc32(sensor.encode())


def pcg64_states(entropy: Sequence[int | NDArray[np.int64]]) -> list[tuple[int, int]]:
    """State and increment of ``numpy.random.default_rng(entropy)``, for many values of the last number at once.

    ``numpy.random.SeedSequence`` hashes the words of the entropy into a pool of four, and this into the seed of PCG64;
    its stream is fixed (NEP 19), so the same is done here on arrays. The last number lies below 2^32.
    """
    *fixed, varied = entropy
    words = [np.array([word], np.uint32) for number in fixed for word in _split(int(number))]
    words.append(np.asarray(varied).astype(np.uint32))
    words += [np.zeros(1, np.uint32)] * (4 - len(words))
    hashed = _Hash(*_HASH_A)
    pool = [hashed(word) for word in words[:4]]
    for source in range(4):
        for target in range(4):
            if source != target:
                pool[target] = _mix(pool[target], hashed(pool[source]))
    for word in words[4:]:
        pool = [_mix(each, hashed(word)) for each in pool]
    hashed = _Hash(*_HASH_B)
    drawn = np.stack([hashed(pool[place % 4]) for place in range(8)], axis=1)
    return [_seed_pcg64(*row) for row in np.ascontiguousarray(drawn).view("<u8").tolist()]


class _Hash:
    """SeedSequence's hash of 32-bit words, whose constant changes with each use."""

    def __init__(self, constant: int, factor: int) -> None:
        self._constant, self._factor = constant, factor

    def __call__(self, words: Words) -> Words:
        hashed: Words = words ^ np.uint32(self._constant)
        self._constant = self._constant * self._factor & _MASK32
        hashed = hashed * np.uint32(self._constant)
        return hashed ^ (hashed >> _SHIFT)


def _mix(one: Words, other: Words) -> Words:
    mixed: Words = _MIX_LEFT * one - _MIX_RIGHT * other
    return mixed ^ (mixed >> _SHIFT)


def _split(number: int) -> list[int]:
    """The 32-bit words of a number, the lowest first."""
    words = [number & _MASK32]
    while number := number >> 32:
        words.append(number & _MASK32)
    return words


def _seed_pcg64(state_high: int, state_low: int, stream_high: int, stream_low: int) -> tuple[int, int]:
    increment = ((stream_high << 64 | stream_low) << 1 | 1) & _MASK128
    state = increment + (state_high << 64 | state_low) & _MASK128
    return (state * _PCG64_FACTOR + increment) & _MASK128, increment
