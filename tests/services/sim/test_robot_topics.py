"""When messages of a rate are due."""

from __future__ import annotations

import pytest

from services.runtime.step import STEP_NS
from services.sim.robot_topics import CONTROL_STEPS, is_due

SECOND = 1_000_000_000 // STEP_NS


def due_ticks(rate: float, end: int = SECOND) -> list[int]:
    """Return the control ticks before ``end`` at which a message is due."""
    return [tick for tick in range(0, end, CONTROL_STEPS) if is_due(tick * STEP_NS, rate)]


@pytest.mark.parametrize("rate", [50.0, 25.0, 50 / 3, 12.5, 10.0])
def test_a_rate_that_divides_the_control_rate_is_due_at_equal_distances(rate: float) -> None:
    hour = 3600 * SECOND
    steps = round(SECOND / rate)
    assert due_ticks(rate) == list(range(0, SECOND, steps))
    late = range(hour - hour % steps, hour + 10 * steps, CONTROL_STEPS)
    assert [tick for tick in late if is_due(tick * STEP_NS, rate)] == list(late[:: steps // CONTROL_STEPS])


def test_other_rates_are_exact_on_average() -> None:
    assert due_ticks(20.0, 80) == [0, 12, 20, 32, 40, 52, 60, 72]
    assert due_ticks(30.0, 80) == [0, 8, 16, 20, 28, 36, 40, 48, 56, 60, 68, 76]
    assert due_ticks(40.0, 40) == [0, 8, 12, 16, 20, 28, 32, 36]
    for rate in (20.0, 30.0, 40.0, 7.0):
        assert len(due_ticks(rate, 10 * SECOND)) == 10 * rate


def test_rates_beyond_that_of_control_ticks_are_due_at_each() -> None:
    assert due_ticks(1000.0) == list(range(0, SECOND, CONTROL_STEPS))
    assert due_ticks(0.0) == []
