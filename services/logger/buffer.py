"""Rows of numbers on their way from messages to arrays, bounded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LIMIT = 20_000
"""Rows kept between two batches: more than six minutes of a 50 Hz topic."""


class Buffer:
    """Collects rows of ``width`` numbers, the first of them a time [ns]; beyond ``limit`` the oldest are dropped.

    Times pass through doubles: exact below 104 days.
    """

    def __init__(self, width: int, limit: int = LIMIT) -> None:
        self.width, self.limit = width, limit
        self.dropped = 0
        self._rows: list[tuple[float, ...]] = []

    def extend(self, rows: Sequence[tuple[float, ...]]) -> None:
        """Add rows, newest last."""
        self._rows += rows
        excess = len(self._rows) - self.limit
        if excess > 0:
            del self._rows[:excess]
            self.dropped += excess

    def take(self) -> NDArray[np.float64]:
        """All rows as an array of shape (n, width); the buffer is empty afterwards."""
        rows, self._rows = self._rows, []
        return np.array(rows, dtype=np.float64).reshape(-1, self.width)
