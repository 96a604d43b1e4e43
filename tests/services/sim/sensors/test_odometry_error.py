"""The odometry of a TurtleBot drifts like a real one's, only through a seeded error of its wheel geometry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from messages.nav import Odometry
from messages.requests import RESET, SET_ODOMETRY
from messages.se2 import Pose2
from messages.se3 import Pose3
from messages.simulation import SetOdometry
from messages.std import Empty
from messages.topics import IMU, JOINT_STATES, ODOM, TF_STATIC
from models.model import OdometryErrorConfig, read_model
from services.sim.drive.kinematics import WheelGeometry
from services.sim.drive.odometry import initial_odometry, integrate_encoders
from services.sim.drive.odometry_error import (
    MAX_DEVIATIONS,
    NO_ERROR,
    ErrorDraws,
    OdometryError,
    assumed_geometry,
    draw_errors,
    odometry_error,
)
from tests.services.sim.drive.simulation_harness import NAME, SimulationHarness, run_simulation

START = Pose3.planar(-2.0, -0.5, 0.7)


def planar(message: Odometry) -> Pose2:
    return Pose2.from_msg(message.pose.pose)


def loop(world: SimulationHarness) -> tuple[Pose2, Pose2]:
    """Turn by 3 rad and drive 1 m; return the true pose and that of odometry."""
    world.drive(0.0, 1.5, 2.0)
    world.drive(0.2, 0.0, 5.0)
    return planar(world.truth()), planar(world.latest(ODOM))


def drift(one: Pose2, other: Pose2) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


@pytest.mark.slow
def test_odometry_drifts_by_the_seed_and_the_motion_does_not_depend_on_it() -> None:
    seen = {}
    runs: tuple[tuple[int, dict[str, Any]], ...] = (
        (0, {}),
        (0, {"noise": True}),
        (1, {}),
        (0, {"odometry_error": 0.0}),
        (0, {"odometry": "world"}),
    )
    for seed, parameters in runs:
        with run_simulation("burger", START, seed, **parameters) as world:
            world.subscribe(IMU)
            world.subscribe(JOINT_STATES)
            assert drift(planar(world.truth()), Pose2(-2.0, -0.5)) < 1e-6
            truth, believed = loop(world)
            rates = [each.angular_velocity.z for each in world.received(IMU)]
            seen[seed, *parameters] = truth, believed, rates, world.received(JOINT_STATES)[-1].position, world.log
    plain, again, other, exact, true = seen.values()
    assert plain[:4] == again[:4], "a run repeats"
    assert 0.005 < drift(plain[0], plain[1]) < 0.1
    assert drift(plain[1], other[1]) > 0.002, "another seed, another robot"
    for each in (exact, true):
        assert (each[0], each[2], each[3]) == (plain[0], plain[2], plain[3]), "body, IMU and encoders are as they were"
    assert drift(true[0], true[1]) < 1e-6
    assert drift(exact[0], exact[1]) < drift(plain[0], plain[1]) / 3, "slip alone is left"
    assert "wheel odometry assumes a wrong wheel geometry (drawn from seed 0): left radius" in plain[4]
    assert "odometry takes" not in exact[4]


def test_odometry_begins_at_the_true_pose_or_at_zero() -> None:
    with run_simulation("burger", START) as world:
        world.run(0.1)
        assert planar(world.latest(ODOM)) == pytest.approx((-2.0, -0.5, 0.7), abs=1e-3)
        assert world.simulation.robots[0].publishers.odometer.config.in_world
        world.subscribe(TF_STATIC)
        world.call(SET_ODOMETRY, SetOdometry(name=NAME))
        world.run(0.1)
        assert planar(world.latest(ODOM)) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
        offset = world.simulation.robots[0].publishers.odometer.offset
        assert (offset.x, offset.y, offset.yaw) == pytest.approx((-2.0, -0.5, 0.7), abs=1e-3), "the frame moves instead"
        world.call(RESET, Empty())
        world.run(0.1)
        assert planar(world.latest(ODOM)) == pytest.approx((-2.0, -0.5, 0.7), abs=1e-3)
    with run_simulation("burger", START, odometry_origin="start") as world:
        world.run(0.1)
        assert planar(world.latest(ODOM)) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_the_draws_belong_to_robot_and_seed() -> None:
    assert draw_errors(3, "tb3_0") == draw_errors(3, "tb3_0")
    assert len({draw_errors(seed, name) for seed in range(20) for name in ("tb3_0", "tb3_1")}) == 40
    many = np.array([draw_errors(seed, "tb3") for seed in range(500)])
    assert np.abs(many).max() <= MAX_DEVIATIONS
    assert many.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.1)
    assert many.std(axis=0) == pytest.approx([0.95] * 3, abs=0.08)
    config = OdometryErrorConfig(wheel_radius=0.003, wheel_radius_ratio=0.001, wheel_separation=0.01)
    made = odometry_error(config, 2.0, ErrorDraws(1.0, -1.0, 0.5))
    assert made == pytest.approx((1.007, 1.005, 1.01), abs=1e-4)
    assert made.describe() == "left radius +0.70 %, right radius +0.50 %, separation +1.01 %"
    assert odometry_error(config, 0.0, ErrorDraws(1.0, -1.0, 0.5)) == NO_ERROR
    assert read_model("p3dx").odometry_error == OdometryErrorConfig(), "the Pioneer counts exactly"


def square_error(geometry: WheelGeometry, error: OdometryError, side: float = 4.0) -> float:
    """Return UMBmark's error: the distance [m] from the start that odometry gives after a perfect square."""
    believed, assumed, left, right = initial_odometry(0.0, 0.0), assumed_geometry(geometry, error), 0.0, 0.0
    for _ in range(4):
        for ahead, turn in ((side, 0.0), (0.0, math.pi / 2)):
            left += (ahead - turn * geometry.separation / 2) / geometry.left_radius
            right += (ahead + turn * geometry.separation / 2) / geometry.right_radius
            believed = integrate_encoders(believed, left, right, 1.0, assumed)
    return math.hypot(believed.x, believed.y)


def test_the_drift_is_of_the_size_that_was_measured_on_real_robots() -> None:
    """0.1 m to 0.5 m on UMBmark's square of 4 m, RMS over many robots; see models/burger/README.md."""
    for name in ("burger", "waffle", "waffle_pi"):
        model = read_model(name)
        assert model.wheels is not None
        geometry = WheelGeometry(model.wheels.separation, model.wheels.radius, model.wheels.radius)
        assert square_error(geometry, NO_ERROR) < 1e-9
        drawn = (odometry_error(model.odometry_error, 1.0, draw_errors(seed, "r")) for seed in range(300))
        errors = [square_error(geometry, each) for each in drawn]
        assert 0.1 < math.sqrt(float(np.mean(np.square(errors)))) < 0.5, name
