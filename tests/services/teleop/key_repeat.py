"""Keyboards as they are: events of a key that is held, with a delay, an interval and some jitter."""

from __future__ import annotations

import random
from collections.abc import Sequence

from services.teleop.hold_detector import HoldDetector, pressed

FIRST_TIMEOUT_S = 0.6
"""The time-out of a first event before anything is learned, s."""


def key_repeat(
    start: float, seconds: float, delay: float, interval: float, jitter: float = 0.0, seed: int = 0
) -> list[float]:
    """The times of the events; each comes late by up to ``jitter``, as part of the interval."""
    chance = random.Random(seed)
    times, due = [start], start + delay
    while due <= start + seconds:
        times.append(due + chance.random() * jitter * interval)
        due += interval
    return times


def timeouts(man: HoldDetector, times: Sequence[float], key: str = "i") -> tuple[HoldDetector, list[float]]:
    """The switch after these events, and the times within the hold at which it had let go."""
    let_go = []
    for index, at in enumerate(times):
        if index and not man.is_held(at):
            let_go.append(man.held_until)
        man = pressed(man, key, at)
    return man, let_go
