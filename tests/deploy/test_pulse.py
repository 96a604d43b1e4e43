"""When a process counts as hanging, on a clock of numbers."""

from __future__ import annotations

import pytest

from deploy.supervisor.pulse import GRACE_S, LIMIT_S, LOOK_S, Pulse
from services.runtime.health import PERIOD_S


def test_grace_before_the_first_beat() -> None:
    pulse = Pulse(100.0)
    assert not pulse.hangs(100.0 + GRACE_S)
    assert pulse.hangs(100.1 + GRACE_S)
    assert not pulse.well(100.1)


def test_three_missed_beats() -> None:
    pulse = Pulse(0.0)
    pulse.heard(5.0)
    assert pulse.well(4.9 + 2 * PERIOD_S)
    assert not pulse.well(5.1 + 2 * PERIOD_S)
    assert not pulse.hangs(5.0 + LIMIT_S)
    assert pulse.hangs(5.01 + LIMIT_S)
    pulse.heard(7.0)
    assert not pulse.hangs(7.0 + LIMIT_S)


def test_excused_silence_counts_from_the_excuse() -> None:
    pulse = Pulse(0.0)
    pulse.heard(1.0)
    pulse.excuse(4.0, 3.0)
    assert not pulse.hangs(7.0)
    assert pulse.hangs(7.1)


def test_an_excuse_never_shortens_the_time() -> None:
    pulse = Pulse(0.0)
    pulse.excuse(1.0, 1.0)
    assert not pulse.hangs(GRACE_S)


def test_time_in_which_it_could_not_beat_does_not_count() -> None:
    pulse = Pulse(0.0)
    pulse.heard(1.0)
    for _ in range(10):
        pulse.defer(0.2)
    assert pulse.held_up == pytest.approx(2.0)
    assert not pulse.hangs(3.0 + LIMIT_S)
    assert pulse.hangs(3.1 + LIMIT_S)
    pulse.heard(5.0)
    assert pulse.held_up == 0.0
    assert pulse.hangs(5.1 + LIMIT_S)


def test_its_silence_is_looked_into_before_it_counts_as_hanging() -> None:
    pulse = Pulse(0.0)
    assert not pulse.is_late(GRACE_S - LOOK_S)
    assert pulse.is_late(GRACE_S - LOOK_S + 0.1)
    pulse.heard(1.0)
    assert not pulse.is_late(1.0 + LIMIT_S - LOOK_S)
    assert pulse.is_late(1.1 + LIMIT_S - LOOK_S)
    pulse.defer(1.0)
    assert pulse.is_late(1.1 + LIMIT_S - LOOK_S)
    pulse.excuse(4.0)
    assert not pulse.is_late(4.1)
