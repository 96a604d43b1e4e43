"""The reference's waveforms: values, continuity at changes, and start values."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from services.reference import ReferenceParameters
from services.reference.waveforms import BLEND_S, ReferenceTable, WaveformGenerator

DT = 0.02


def follow(forms: WaveformGenerator, seconds: float, **parameters: Any) -> list[float]:
    p = ReferenceParameters(**parameters)
    return [forms.step(p, DT) for _ in range(round(seconds / DT))]


def steepest(values: list[float]) -> float:
    """Return the largest slope [deg/s]."""
    return max(abs(b - a) for a, b in pairwise(values)) / DT


def test_a_step_is_its_angle_at_once() -> None:
    forms = WaveformGenerator()
    assert follow(forms, 0.1) == [0.0] * 5
    assert follow(forms, 0.1, ref_angle=30.0) == [30.0] * 5


def test_a_sine_begins_at_0_and_has_its_gain_and_frequency() -> None:
    values = follow(WaveformGenerator(), 10.0, reference_type="sine", sin_ref_gain=30.0, sin_ref_f=0.2)
    assert values == pytest.approx([30.0 * math.sin(math.tau * 0.2 * DT * step) for step in range(500)], abs=1e-9)


@pytest.mark.parametrize(("angle", "phase"), [(30.0, 0.25), (15.0, 1 / 12), (-15.0, 11 / 12), (80.0, 0.25)])
def test_a_sine_goes_on_from_the_present_angle_upward(angle: float, phase: float) -> None:
    """From an angle beyond its gain it starts at its extreme, for the smallest jump."""
    forms = WaveformGenerator()
    follow(forms, 0.1, ref_angle=angle)
    values = follow(forms, 1.0, reference_type="sine", sin_ref_gain=30.0, sin_ref_f=0.2)
    assert values[0] == pytest.approx(max(-30.0, min(30.0, angle)))
    assert values == pytest.approx([30.0 * math.sin(math.tau * (phase + 0.2 * DT * step)) for step in range(50)])


def test_a_change_of_frequency_is_no_jump() -> None:
    """The tutorial's sine, of the time since the start, would jump by up to twice the gain."""
    forms = WaveformGenerator()
    before = follow(forms, 7.3, reference_type="sine", sin_ref_gain=30.0, sin_ref_f=0.2)
    after = follow(forms, 5.0, reference_type="sine", sin_ref_gain=30.0, sin_ref_f=1.0)
    assert abs(after[0] - before[-1]) <= math.tau * 30.0 * 1.0 * DT
    assert steepest(before + after) <= math.tau * 30.0 * 1.0
    assert max(after) == pytest.approx(30.0, abs=0.1)


def test_a_change_of_amplitude_is_let_in() -> None:
    forms = WaveformGenerator()
    before = follow(forms, 6.25, reference_type="sine", sin_ref_gain=30.0, sin_ref_f=0.2)
    after = follow(forms, 5.0, reference_type="sine", sin_ref_gain=10.0, sin_ref_f=0.2)
    assert before[-1] > 29.0, "at its height, where the jump would be largest"
    assert steepest(before + after) <= 20.0 / BLEND_S + math.tau * 30.0 * 0.2
    assert max(after[round(BLEND_S / DT) + 1 :]) == pytest.approx(10.0, abs=0.01)


def test_a_ramp_keeps_to_its_rate_and_ends_on_its_angle() -> None:
    forms = WaveformGenerator()
    follow(forms, 0.1, ref_angle=5.0)
    values = follow(forms, 4.0, reference_type="ramp", ref_angle=-20.0, ramp_rate=10.0)
    assert values[0] == 5.0
    assert steepest(values) == pytest.approx(10.0)
    assert values[-1] == -20.0


def test_a_ramp_does_not_come_back_from_beyond_the_joint() -> None:
    """A ramp from 300 deg, which the joint never reached, would keep it at its limit for 21 s."""
    forms = WaveformGenerator()
    follow(forms, 0.1, ref_angle=300.0)
    values = follow(forms, 1.0, reference_type="ramp", ref_angle=0.0, ramp_rate=10.0)
    assert (values[0], values[-1]) == pytest.approx((90.0, 80.2))
    follow(forms, 2.0, reference_type="ramp", ref_angle=300.0, ramp_rate=100.0)
    assert follow(forms, 1.0, reference_type="ramp", ref_angle=0.0, ramp_rate=10.0)[-1] == pytest.approx(80.0, abs=2.1)


def test_a_square_is_as_long_up_as_down() -> None:
    values = follow(WaveformGenerator(), 10.0, reference_type="square", sin_ref_gain=20.0, sin_ref_f=0.2)
    assert set(values) == {20.0, -20.0}
    assert values[:124] == [20.0] * 124
    assert abs(sum(values)) <= 4 * 20.0


def test_a_chirp_goes_evenly_from_one_frequency_to_the_other_and_stays() -> None:
    forms = WaveformGenerator()
    p = ReferenceParameters(reference_type="chirp", chirp_from=0.5, chirp_to=2.0, chirp_time=10.0, sin_ref_gain=10.0)
    values, turns = [], 0.0
    before = 0.0
    for _ in range(600):
        values.append(forms.step(p, DT))
        turns += ((forms.phase - before) % math.tau) / math.tau
        before = forms.phase
    after = 599 * DT - 10.0
    assert turns == pytest.approx(10.0 * (0.5 + 2.0) / 2 + 2.0 * after, abs=1e-6)
    assert max(map(abs, values)) <= 10.0
    assert steepest(values) <= math.tau * 2.0 * 10.0


def test_a_table_is_followed_from_its_beginning() -> None:
    table = ReferenceTable([1.0, 2.0, 4.0], [10.0, 20.0, 0.0])
    forms = WaveformGenerator(table)
    follow(forms, 1.0, ref_angle=-3.0)
    values = follow(forms, 5.0, reference_type="csv")
    assert (values[0], values[round(1.0 / DT)]) == pytest.approx((10.0, 10.0))
    assert values[round(1.5 / DT)] == pytest.approx(15.0)
    assert values[round(3.0 / DT)] == pytest.approx(10.0)
    assert values[-1] == 0.0
    assert table.at(5.5, repeat=True) == pytest.approx(15.0)
    assert table.at(0.0) == 10.0


def test_without_a_table_it_holds() -> None:
    forms = WaveformGenerator()
    follow(forms, 0.1, ref_angle=12.0)
    assert follow(forms, 0.1, reference_type="csv") == [12.0] * 5
