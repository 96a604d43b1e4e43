"""Rotations agree with the textbook matrix and undo each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from services.sim.physics.rotation import rotation_matrix, to_body_frame, to_world_frame

number = st.floats(-1, 1)


@given(st.tuples(number, number, number, number), st.tuples(number, number, number))
def test_there_and_back(raw: tuple[float, float, float, float], vector: tuple[float, float, float]) -> None:
    length = math.hypot(*raw)
    assume(length > 0.1)
    x, y, z, w = (part / length for part in raw)
    assert to_world_frame((x, y, z, w), to_body_frame((x, y, z, w), vector)) == pytest.approx(vector, abs=1e-12)
    textbook = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert rotation_matrix((x, y, z, w)) == pytest.approx(textbook, abs=1e-12)
    assert to_body_frame((x, y, z, w), vector) == pytest.approx(tuple(textbook.T @ vector), abs=1e-12)
