"""Interpolation of references that arrive less often than the arm's control ticks."""

from __future__ import annotations

import math
import random

import pytest

from services.arm.reference_interpolator import WINDOW, PeriodEstimator, ReferenceInterpolator, SetPoint

MS = 1_000_000


def taught(samples: list[float], every: int = 20 * MS) -> tuple[ReferenceInterpolator, int]:
    target = ReferenceInterpolator()
    for number, sample in enumerate(samples):
        target.add_sample(sample, number * every)
    return target, (len(samples) - 1) * every


def test_before_the_first_there_is_none() -> None:
    assert ReferenceInterpolator().sample is None
    assert ReferenceInterpolator().age(5) == math.inf


def test_a_motion_goes_on_between_its_samples() -> None:
    samples = [30.0 * math.sin(math.tau * 0.2 * 0.02 * step) for step in range(200)]
    worst = 0.0
    for count in range(4, 200):
        target, now = taught(samples[:count])
        for late in (0, 5, 10, 15):
            angle = target.at(now + late * MS, smooth=True).angle
            true = 30.0 * math.sin(math.tau * 0.2 * (now + late * MS) / 1e9)
            worst = max(worst, abs(angle - true))
    assert worst < 0.002, "a stair would be off by 0.57"


@pytest.mark.parametrize("before", [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
def test_a_step_stays_a_step(before: list[float]) -> None:
    target, now = taught([*before, 30.0])
    assert [target.at(now + late * MS, smooth=True) for late in (0, 10, 20, 200)] == [SetPoint(30.0)] * 4


def test_it_goes_on_for_an_interval_and_then_stands() -> None:
    """For one and a half intervals, since a sample may be late."""
    target, now = taught([0.0, 1.0, 2.0, 3.0])
    assert target.at(now + 10 * MS, smooth=True).angle == pytest.approx(3.5)
    assert target.at(now + 20 * MS, smooth=True) == pytest.approx((4.0, 50.0, 0.0))
    assert target.at(now + 60 * MS, smooth=True) == pytest.approx((4.5, 0.0, 0.0))
    target.hold()
    assert target.at(now + 600 * MS, smooth=True) == SetPoint(3.0)
    assert target.age(now + 600 * MS) == pytest.approx(0.6)


def test_the_tutorials_law_has_the_steps() -> None:
    target, now = taught([0.0, 1.0, 2.0])
    assert target.at(now + 10 * MS, smooth=False) == SetPoint(2.0)


def heard(tick: int, late: int, lost: float = 0.0, seed: int = 1) -> list[tuple[int, SetPoint, float, float]]:
    """Ticks every ``tick`` ms that receive a sine sampled at 50 Hz, each sample up to ``late`` ticks late and a share
    ``lost`` dropped; return time [ms], set point, and the true angle [deg] and rate [deg/s].
    """
    dice, target, waiting, told = random.Random(seed), ReferenceInterpolator(), [(0, 0.0)], []
    w = math.tau * 0.2
    for ms in range(0, 5000, 5):
        if ms % 20 == 0 and dice.random() >= lost:
            due = ms + tick * dice.randint(0, late)
            waiting.append((max(due, waiting[-1][0] if waiting else 0), 30.0 * math.sin(w * ms / 1000)))
        if ms % tick == 0:
            while waiting and waiting[0][0] <= ms:
                target.add_sample(waiting.pop(0)[1], ms * MS)
            true = 30.0 * math.sin(w * ms / 1000), 30.0 * w * math.cos(w * ms / 1000)
            told.append((ms, target.at(ms * MS, smooth=True), *true))
    return told


@pytest.mark.parametrize(("tick", "late", "lost", "off"), [(5, 1, 0.0, 0.3), (5, 2, 0.0, 0.5), (10, 0, 0.05, 0.05)])
def test_late_and_lost_samples_do_not_halt_the_motion(tick: int, late: int, lost: float, off: float) -> None:
    """Without interpolation they would: the rate fell to 0 at each, a torque spike of 49 N m."""
    for _, wanted, angle, rate in heard(tick, late, lost)[1000 // tick :]:
        assert wanted.angle == pytest.approx(angle, abs=off)
        assert wanted.rate == pytest.approx(rate, abs=max(8.0, 0.2 * abs(rate)))


@pytest.mark.parametrize("seconds", [0.25, 1.0, 5.0])
def test_references_that_come_seldom_are_steps(seconds: float) -> None:
    """Three manual steps of 10 deg each aren't a motion to extrapolate."""
    target, now = taught([0.0, 10.0, 20.0, 30.0], round(seconds * 1000) * MS)
    assert [target.at(now + late * MS, smooth=True) for late in (0, 20, 200, 900)] == [SetPoint(30.0)] * 4


def test_a_burst_is_the_newest_of_it() -> None:
    target = ReferenceInterpolator()
    for now in (0, 20, 40):
        for sample in range(3 * WINDOW):
            target.add_sample(float(sample), now * MS)
        assert target.at(now * MS, smooth=True).angle == 3 * WINDOW - 1
    for now in range(60, 2000, 20):
        target.add_sample(5.0, now * MS)
    assert target.at(2000 * MS, smooth=True) == SetPoint(5.0)


def test_a_cadence_is_exact_where_nothing_is_late_and_begins_anew_after_a_gap() -> None:
    cadence = PeriodEstimator()
    assert [cadence.add_sample(now * MS) for now in range(0, 1000, 20)] == [None, *[1] * 49]
    assert (cadence.period, cadence.nominal_time) == (20 * MS, 980 * MS)
    assert cadence.add_sample(1040 * MS) == 3, "two are lost"
    assert cadence.add_sample(1145 * MS) is None
    assert [cadence.add_sample(now * MS) for now in (1185, 1225)] == [1, 1]
    assert (cadence.period, cadence.nominal_time) == (40 * MS, 1225 * MS)
