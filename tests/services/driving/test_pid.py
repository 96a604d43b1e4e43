"""The wheel's PID: each term, both ways of clamping the integral, and output that is always finite."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.driving.pid import INITIAL_PID_STATE, PidGains, PidState, pid_command

DT = 0.01


def series(gains: PidGains, errors: list[float]) -> list[float]:
    memory, out = INITIAL_PID_STATE, []
    for error in errors:
        effort, memory = pid_command(gains, memory, error, DT)
        out.append(effort)
    return out


def test_terms_add_up() -> None:
    efforts = series(PidGains(p=2.0, i=10.0, d=0.1, i_min=-9, i_max=9), [1.0, 1.5])
    assert efforts[0] == pytest.approx(2.0 + 10 * 0.01), "no derivative at the first sample"
    assert efforts[1] == pytest.approx(3.0 + 10 * 0.025 + 0.1 * 0.5 / DT)


def test_without_an_i_clamp_the_integral_does_nothing() -> None:
    assert series(PidGains(p=5.0, i=0.1, d=0.0), [1.0] * 500) == [5.0] * 500


def test_without_antiwindup_the_share_is_clamped_and_the_integral_winds_up() -> None:
    gains = PidGains(p=0.0, i=1.0, i_min=-0.5, i_max=0.5)
    efforts = series(gains, [1.0] * 200 + [-1.0] * 200)
    assert max(efforts) == 0.5
    assert efforts[300] == 0.5, "2 s of error must be undone before the share moves"


def test_with_antiwindup_it_turns_at_once() -> None:
    gains = PidGains(p=0.0, i=2.0, i_min=-0.5, i_max=0.5, antiwindup=True)
    efforts = series(gains, [1.0] * 200 + [-1.0] * 10)
    assert efforts[199] == 0.5
    assert efforts[200] == pytest.approx(0.5 - 2.0 * DT)


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=40), st.floats(0, 1e3), st.floats(0.01, 100))
def test_the_torque_is_finite_and_limited_whatever_the_error(errors: list[float], p: float, most: float) -> None:
    for effort in series(PidGains(p, 1.0, 0.1, -5, 5, limit=most), errors):
        assert math.isfinite(effort)
        assert abs(effort) <= most


@pytest.mark.parametrize(("error", "dt"), [(math.nan, DT), (math.inf, DT), (1.0, 0.0), (1.0, -DT), (1.0, math.nan)])
def test_no_error_or_no_time_gives_nothing_and_changes_nothing(error: float, dt: float) -> None:
    memory = PidState(0.3, 2.0)
    assert pid_command(PidGains(5.0, 1.0, 1.0, -1, 1), memory, error, dt) == (0.0, memory)
