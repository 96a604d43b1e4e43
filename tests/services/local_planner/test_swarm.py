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
def test_a_large_swarm_reaches_shuffled_places_without_contact() -> None:
    starts, seed = square(100), 2
    goals = [starts[k] for k in np.random.default_rng(seed).permutation(100)]
    outcome = drive(starts, goals, seed, LIMIT_S)
    assert outcome.arrived == 100, outcome
    assert outcome.nearest > 0.005, outcome


@pytest.mark.slow
def test_robots_that_all_cross_one_point_or_meet_head_on_part_again() -> None:
    crossing, meeting = square(25), square(36)
    for seed, starts, goals in (
        (0, crossing, [(4 * SPACING - x, 4 * SPACING - y) for x, y in crossing]),
        (1, meeting, [(5 * SPACING - x, y) for x, y in meeting]),
    ):
        outcome = drive(starts, goals, seed, LIMIT_S)
        assert outcome.arrived == len(starts), outcome
        assert outcome.nearest > 0.005, outcome


def test_two_that_meet_head_on_pass_each_other_on_the_right() -> None:
    outcome = drive([(0.0, 0.0), (3.0, 0.0)], [(3.0, 0.0), (0.0, 0.0)], 1, 40.0)
    assert outcome.arrived == 2
    assert outcome.seconds < 25.0
    assert outcome.nearest > 0.02
