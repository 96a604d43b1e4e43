"""Swarms with crossing paths: all robots arrive, and none touch."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.services.local_planner.kinematic_swarm import Point, drive

SPACING = 1.0
LIMIT_S = 240.0


def square(count: int) -> list[Point]:
    side = math.ceil(math.sqrt(count))
    return [(SPACING * (k % side), SPACING * (k // side)) for k in range(count)]


@pytest.mark.slow
def test_swarms_of_any_size_reach_shuffled_places_without_contact() -> None:
    for count, seed in ((36, 0), (100, 2)):
        starts = square(count)
        goals = [starts[k] for k in np.random.default_rng(seed).permutation(count)]
        outcome = drive(starts, goals, seed, LIMIT_S)
        assert outcome.arrived == count, (count, seed, outcome)
        assert outcome.nearest > 0.005, (count, seed, outcome)


@pytest.mark.slow
def test_robots_that_all_cross_one_point_or_meet_head_on_part_again() -> None:
    starts = square(36)
    end = starts[-1][0]
    for seed, goals in enumerate(([(end - x, end - y) for x, y in starts], [(end - x, y) for x, y in starts])):
        outcome = drive(starts, goals, seed, LIMIT_S)
        assert outcome.arrived == len(starts), outcome
        assert outcome.nearest > 0.005, outcome


def test_two_that_meet_head_on_pass_each_other_on_the_right() -> None:
    outcome = drive([(0.0, 0.0), (3.0, 0.0)], [(3.0, 0.0), (0.0, 0.0)], 1, 40.0)
    assert outcome.arrived == 2
    assert outcome.seconds < 25.0
    assert outcome.nearest > 0.02
