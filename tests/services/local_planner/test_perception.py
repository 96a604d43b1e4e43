"""From scans to moving circles: discs and walls are distinguished, located and tracked."""

from __future__ import annotations

import math

import numpy as np

from messages.base import Float32Array
from messages.se2 import Pose2
from messages.sensor import LaserScan
from messages.std import Header, Time
from services.local_planner import LocalPlannerParameters
from services.local_planner.detection import detect
from services.local_planner.tracking import Tracker

PARAMS = LocalPlannerParameters()
HEAD = PARAMS.seen_radius
RAYS = 360


def scan(discs: list[tuple[float, float]], wall_x: float | None = None, noise: float = 0.0, seed: int = 0) -> LaserScan:
    """Return a scan from the origin of robots' laser heads at these places and a wall across the x axis."""
    angles = np.arange(RAYS) * math.tau / RAYS
    ranges = np.full(RAYS, np.inf)
    if wall_x is not None:
        ranges = np.where(np.cos(angles) > 0.01, wall_x / np.maximum(np.cos(angles), 0.01), ranges)
    for x, y in discs:
        along = x * np.cos(angles) + y * np.sin(angles)
        across = x * x + y * y - along * along
        hit = (along > 0) & (across < HEAD * HEAD)
        ranges = np.where(hit, np.minimum(ranges, along - np.sqrt(np.maximum(HEAD * HEAD - across, 0))), ranges)
    ranges += np.random.default_rng(seed).normal(0, noise, RAYS) if noise else 0
    return LaserScan(
        header=Header(stamp=Time.of(0)),
        angle_max=math.tau,
        angle_increment=math.tau / RAYS,
        range_min=0.12,
        range_max=3.5,
        ranges=Float32Array(ranges),
    )


def test_robots_are_found_all_around_also_where_the_turn_begins() -> None:
    places = [(1.0, 0.0), (-0.5, 0.3), (0.0, -1.4), (0.25, 0.15)]
    found = detect(scan(places, noise=0.01), PARAMS)
    assert not len(found.points)
    assert len(found.discs) == len(places)
    for place in places:
        assert min(math.dist(place, each) for each in found.discs.tolist()) < 0.02


def test_what_is_out_of_view_is_not_considered() -> None:
    found = detect(scan([(PARAMS.view + 0.2, 0.0)]), PARAMS)
    assert not len(found.discs) + len(found.points)


def test_a_wall_is_points_on_it_and_a_robot_before_it_is_still_a_disc() -> None:
    found = detect(scan([(0.5, 0.0)], wall_x=1.0), PARAMS)
    assert len(found.discs) == 1
    assert math.dist((0.5, 0.0), found.discs[0]) < 0.01
    assert len(found.points) > 10
    assert np.abs(found.points[:, 0] - 1.0).max() < 0.01
    assert found.points[:, 1].min() < -1.0
    assert found.points[:, 1].max() > 1.0


def test_the_velocity_of_a_robot_is_known_after_a_few_scans_from_a_robot_that_moves_itself() -> None:
    tracker = Tracker()
    for number in range(12):
        time = 0.2 * number
        laser = Pose2(0.1 * time, -0.05 * time, 0.3 * time)
        other = (1.0, 0.2 - 0.2 * time)
        seen = laser.inverse() @ Pose2(*other)
        tracker.update(round(time * 1e9), laser, detect(scan([(seen.x, seen.y)], noise=0.005, seed=number), PARAMS))
    around = tracker.obstacles(round(2.4e9))
    assert around.robots.tolist() == [True]
    assert math.dist(around.velocities[0], (0.0, -0.2)) < 0.05
    assert math.dist(around.positions[0], (1.0, 0.2 - 0.2 * 2.4)) < 0.05
