"""Several robots' values at common times: one plot of the fleet is one entity, however many robots there are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

STALE_NS = 500_000_000
"""A robot that has been silent for longer is not waited for, and has no value."""


class Table:
    """Joins the rows of ``robots``, each of ``width`` values; a robot holds its value until its next row.

    A time is given out once, when every robot that speaks has reached it.
    """

    def __init__(self, robots: int, width: int) -> None:
        self._width = width
        self._times: list[Stamps] = [np.empty(0, np.int64)] * robots
        self._values: list[Floats] = [np.empty((0, width))] * robots
        self._given = -1

    def add(self, robot: int, times: Stamps, values: Floats) -> None:
        """Rows of one robot: ``times`` (n,) [ns], ``values`` (n, width)."""
        self._times[robot] = np.concatenate((self._times[robot], times))
        self._values[robot] = np.concatenate((self._values[robot], values))

    def take(self, everything: bool = False) -> tuple[Stamps, Floats]:
        """New times (n,) [ns] and values (n, robots, width), NaN where a robot has none."""
        ends = [int(each[-1]) for each in self._times if len(each)]
        if not ends:
            return np.empty(0, np.int64), np.empty((0, len(self._times), self._width))
        reached = max(ends) if everything else min(end for end in ends if end > max(ends) - STALE_NS)
        pending = np.unique(np.concatenate(self._times))
        times = pending[(pending > self._given) & (pending <= reached)]
        values = np.stack([self._held(robot, times) for robot in range(len(self._times))], axis=1)
        self._given = max(self._given, reached)
        for robot, own in enumerate(self._times):
            used = max(0, int(np.searchsorted(own, reached, side="right")) - 1)
            self._times[robot], self._values[robot] = own[used:], self._values[robot][used:]
        return times, values

    def _held(self, robot: int, times: Stamps) -> Floats:
        own, values = self._times[robot], self._values[robot]
        held = np.full((len(times), self._width), np.nan)
        at = np.searchsorted(own, times, side="right") - 1
        known = at >= 0
        known[known] = times[known] - own[at[known]] <= STALE_NS
        held[known] = values[at[known]]
        return held
