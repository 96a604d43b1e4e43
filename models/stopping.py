"""How far a base runs on after its last command: the theory that reports and tests measure against."""

from __future__ import annotations

from typing import NamedTuple


class Stop(NamedTuple):
    """From the last command to the standstill: s and m."""

    time: float
    distance: float


def stopping(speed: float, timeout: float, brake: float) -> Stop:
    """The stop of a base whose commander falls silent, at ``speed`` [m/s] of either sign.

    It keeps its speed for ``timeout`` [s] after the last command, then brakes evenly at ``brake`` > 0 [m/s2]:
    t = timeout + v / a, s = v timeout + v^2 / 2a. An emergency stop has no time-out: 0. The distance is that of the
    path, never negative.
    """
    if brake <= 0 or timeout < 0:
        raise ValueError(f"a stop needs a brake above 0 and a time-out of at least 0, got {brake} and {timeout}")
    v = abs(speed)
    return Stop(timeout + v / brake, v * timeout + v * v / (2 * brake))
