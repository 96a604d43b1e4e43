"""The speed limit near others, and the choice of a direction around them."""

from __future__ import annotations

import math

import numpy as np

from messages.se2 import Pose2, Twist2
from services.driving.guidance import stopping_speed
from services.local_planner import LocalPlannerParameters
from services.local_planner.avoidance import ZERO_VELOCITY, Velocity, choose_velocity, contact_distances, forward_limit
from services.local_planner.controller import Detour, LocalPlanner
from services.local_planner.tracking import NO_OBSTACLES, Obstacles

PARAMS = LocalPlannerParameters(goals=((5.0, 0.0),))
HERE = Pose2()


def around(*places: tuple[float, float], robots: bool = True) -> Obstacles:
    return Obstacles(np.array(places, float), np.zeros((len(places), 2)), np.full(len(places), robots))


def test_two_that_close_in_at_their_limit_stop_before_they_touch() -> None:
    contact = contact_distances(around((1.0, 0.0)), PARAMS)[0]
    for free in np.linspace(0.01, 1.0, 50):
        speed = forward_limit(HERE, around((contact + free, 0.0)), PARAMS)
        way = speed * PARAMS.lag + speed * speed / (2 * PARAMS.deceleration)
        assert 2 * way <= free + 1e-9
        assert math.isclose(speed, stopping_speed(free / 2, PARAMS.max_linear, PARAMS.deceleration, PARAMS.lag))


def test_only_what_is_ahead_limits_the_speed_and_a_wall_leaves_the_whole_distance() -> None:
    assert forward_limit(HERE, NO_OBSTACLES, PARAMS) == PARAMS.max_linear
    assert forward_limit(HERE, around((-0.3, 0.0), (0.0, 0.3)), PARAMS) == PARAMS.max_linear
    assert forward_limit(HERE, around((0.25, 0.0)), PARAMS) == 0.0
    assert forward_limit(HERE, around((0.5, 0.0), robots=False), PARAMS) > forward_limit(
        HERE, around((0.5, 0.0)), PARAMS
    )


def test_a_free_robot_takes_what_it_wants_and_one_in_the_way_is_passed_on_the_right() -> None:
    wanted = Velocity(0.2, 0.0)
    assert choose_velocity(wanted, ZERO_VELOCITY, ZERO_VELOCITY, HERE, NO_OBSTACLES, PARAMS) == wanted
    chosen = choose_velocity(wanted, wanted, wanted, HERE, around((0.4, 0.0)), PARAMS)
    assert chosen.x > 0
    assert chosen.y < 0
    assert math.hypot(*chosen) <= 0.2 + 1e-9


def test_a_blocked_robot_stands_and_after_its_patience_tries_another_direction_the_same_in_each_run() -> None:
    courses = []
    for _ in range(2):
        detour, angles = Detour("/tb3_0/local_planner"), []
        for _ in range(300):
            detour.update(1.0, 0.1, PARAMS.patience)
            angles.append(detour.angle)
        courses.append(angles)
    assert courses[0] == courses[1]
    assert not any(courses[0][: round(PARAMS.patience / 0.1)])
    assert len({angle for angle in courses[0] if angle}) >= 2
    assert courses[0] != [0.0] * 300


def test_a_robot_walled_in_never_drives_but_may_turn() -> None:
    planner = LocalPlanner(PARAMS)
    ring = around(*((0.22 * math.cos(a), 0.22 * math.sin(a)) for a in np.linspace(0, math.tau, 24)), robots=False)
    for _ in range(200):
        progress = planner.step(HERE, Twist2(), ring, 0.1)
        assert progress.state == "driving"
        assert progress.command is not None
        assert progress.command.v == 0.0
