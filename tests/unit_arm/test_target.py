"""What the arm makes of references that come less often than it acts."""

from __future__ import annotations

import math

import pytest

from services.arm.target import Motion, Target

MS = 1_000_000


def taught(samples: list[float], every: int = 20 * MS) -> tuple[Target, int]:
    target = Target()
    for number, sample in enumerate(samples):
        target.take(sample, number * every)
    return target, (len(samples) - 1) * every


def test_before_the_first_there_is_none() -> None:
    assert Target().sample is None
    assert Target().age(5) == math.inf


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
    assert [target.at(now + late * MS, smooth=True) for late in (0, 10, 20, 200)] == [Motion(30.0)] * 4


def test_it_goes_on_for_one_interval_and_then_stands() -> None:
    target, now = taught([0.0, 1.0, 2.0, 3.0])
    assert target.at(now + 10 * MS, smooth=True).angle == pytest.approx(3.5)
    assert target.at(now + 20 * MS, smooth=True) == pytest.approx((4.0, 50.0, 0.0))
    assert target.at(now + 60 * MS, smooth=True) == pytest.approx((4.0, 0.0, 0.0))
    target.rest()
    assert target.at(now + 600 * MS, smooth=True) == Motion(3.0)
    assert target.age(now + 600 * MS) == pytest.approx(0.6)


def test_the_law_of_the_seed_has_the_stairs() -> None:
    target, now = taught([0.0, 1.0, 2.0])
    assert target.at(now + 10 * MS, smooth=False) == Motion(2.0)
