"""Simulated key repeat: events of a held key, with a delay, an interval and some jitter."""

from __future__ import annotations

import random
from collections.abc import Sequence

from services.teleop.hold_detector import HoldDetector, pressed

FIRST_TIMEOUT_S = 0.6
"""Time-out [s] of a first event before the keyboard's delay is learned."""


def key_repeat(
    start: float, seconds: float, delay: float, interval: float, jitter: float = 0.0, seed: int = 0
) -> list[float]:
    """Return the times [s] of the events; each repeat is late by up to ``jitter`` times the interval."""
    chance = random.Random(seed)
    times, due = [start], start + delay
    while due <= start + seconds:
        times.append(due + chance.random() * jitter * interval)
        due += interval
    return times


def timeouts(detector: HoldDetector, times: Sequence[float], key: str = "i") -> tuple[HoldDetector, list[float]]:
    """Return the detector after these events, and the times within the hold at which it had released."""
    let_go = []
    for index, at in enumerate(times):
        if index and not detector.is_held(at):
            let_go.append(detector.held_until)
        detector = pressed(detector, key, at)
    return detector, let_go
