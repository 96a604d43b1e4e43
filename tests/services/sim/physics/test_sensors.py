"""Lasers, inertial units and cameras in both engines."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from messages.se3 import Pose3
from messages.sensor import LaserScan
from messages.std import Header
from models import WHEELED
from models.model import LaserConfig, read_model
from models.world import Box, WorldDescription
from services.sim.noise import NoiseSource
from services.sim.physics.world import BodyState, World
from services.sim.sensors import camera_image, camera_info, imu_readings, joint_state, laser_ranges, laser_scan
from tests.services.sim.physics.driven_robot import DT, NewWorld, Spawner, drive_robots, placement_at, robot_body

WALL = Box(name="wall", size=(0.2, 8.0, 1.0), position=(2.1, 0.0, 0.5), colour=(1.0, 0.0, 0.0, 1.0))
HEADER = Header(frame_id="base_scan")


def laser_of(model: str) -> LaserConfig:
    laser = read_model(model).laser
    assert laser is not None
    return laser


def scan_of(world: World, robot: str, laser: LaserConfig, noise: NDArray[np.float64] | None = None) -> LaserScan:
    """Return a scan of one robot's laser."""
    return laser_scan(laser, laser_ranges(world, [robot], laser, [noise])[0], HEADER)


@pytest.mark.parametrize("model", WHEELED)
def test_a_laser_does_not_see_its_own_robot_or_the_ground(spawn: Spawner, world: World, model: str) -> None:
    robot = spawn(model=model)
    drive_robots([robot], 0.2, 1.0, 1.0)
    laser = laser_of(model)
    scan = scan_of(world, "robot", laser)
    ranges = scan.ranges.numpy()
    assert ranges.shape == (laser.samples,)
    assert scan.intensities == [0.0] * laser.samples
    assert np.isinf(ranges).all()
    assert (ranges > 0).all()


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_a_laser_measures_the_wall_in_every_direction(yaw: float, new_world: NewWorld) -> None:
    with new_world(WorldDescription(boxes=(WALL,))) as world:
        world.spawn(robot_body("robot", "burger", placement_at(0.0, 0.0, yaw)))
        world.step()
        turn = scan_of(world, "robot", laser_of("burger"))
    ahead = 2.0 + 0.032 * math.cos(yaw)
    angles = yaw + turn.angle_min + turn.angle_increment * np.arange(360)
    expected = np.full(360, np.inf)
    facing = np.cos(angles) > 0.6
    expected[facing] = ahead / np.cos(angles[facing])
    expected[expected > 3.5] = np.inf
    ranges = turn.ranges.numpy()
    assert ranges[facing] == pytest.approx(expected[facing], abs=2e-3)
    assert np.isinf(ranges[np.cos(angles) < 0.5]).all()
    assert turn.angle_max == pytest.approx(turn.angle_min + 359 * turn.angle_increment)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -1.2])
def test_a_laser_with_a_field_of_view_looks_ahead_from_right_to_left(yaw: float, new_world: NewWorld) -> None:
    with new_world(WorldDescription(boxes=(WALL,))) as world:
        world.spawn(robot_body("robot", "p3dx", placement_at(0.0, 0.0, yaw)))
        world.step()
        turn = scan_of(world, "robot", laser_of("p3dx"))
    assert (turn.angle_min, turn.angle_max) == pytest.approx((-math.pi / 2, math.pi / 2))
    assert turn.angle_increment == pytest.approx(math.radians(1.0))
    angles = yaw + turn.angle_min + turn.angle_increment * np.arange(181)
    across = np.tan(angles) * (2.0 - 0.018 * math.cos(yaw)) + 0.018 * math.sin(yaw)
    facing, aside = (np.cos(angles) > 0.3) & (abs(across) < 3.99), (np.cos(angles) < 0.0) | (abs(across) > 4.3)
    ranges = turn.ranges.numpy()
    assert ranges[facing] == pytest.approx((2.0 - 0.018 * math.cos(yaw)) / np.cos(angles[facing]), abs=2e-3)
    assert np.isinf(ranges[aside]).all()
    assert facing.sum() > 40


@pytest.mark.parametrize("height", [0.18, 0.10])
def test_rays_see_the_body_of_a_pioneer_and_not_the_spheres_on_which_it_rolls(spawn: Spawner, height: float) -> None:
    world = spawn("robot", "p3dx").world
    fraction = world.cast_rays(np.array([[0.0, 2.0, height]]), np.array([[0.0, 0.0, height]]))[0]
    assert 2.0 - 2.0 * fraction == pytest.approx(0.13 if height > 0.14 else 0.19, abs=3e-3)


def test_a_laser_sees_the_other_robot_and_marks_what_is_too_near(
    spawn: Spawner, world: World, new_world: NewWorld
) -> None:
    spawn("robot")
    spawn("other", at=placement_at(0.5, 0.0))
    world.step()
    ranges = scan_of(world, "robot", laser_of("burger")).ranges.numpy()
    assert ranges[0] == pytest.approx(0.5 + 0.015 - 0.055, abs=3e-3)
    near = Box(name="near", size=(0.05, 0.05, 0.5), position=(0.075, 0.0, 0.25))
    with new_world(WorldDescription(boxes=(near,))) as close:
        close.spawn(robot_body("robot", "burger", placement_at(0.0, 0.0)))
        assert scan_of(close, "robot", laser_of("burger")).ranges.numpy()[0] == -np.inf


def test_noise_depends_on_seed_robot_and_tick_alone(new_world: NewWorld) -> None:
    laser = laser_of("burger")
    with new_world(WorldDescription(boxes=(WALL,))) as world:
        world.spawn(robot_body("robot", "burger", placement_at(0.0, 0.0)))
        clean = scan_of(world, "robot", laser).ranges.numpy()

        def noisy(seed: int, robot: str, sensor: str, tick: int) -> bytes:
            noise = NoiseSource(seed, robot, sensor, 40, laser.samples)
            return scan_of(world, "robot", laser, noise.at(tick)).ranges.raw

        first = noisy(1, "robot", "scan", 40)
        assert first == noisy(1, "robot", "scan", 40)
        others = {noisy(2, "robot", "scan", 40), noisy(1, "tb3_1", "scan", 40), noisy(1, "robot", "scan", 80)}
        assert len(others | {first}) == 4
        errors = np.frombuffer(first, "<f4")[np.isfinite(clean)] - clean[np.isfinite(clean)]
        assert np.std(errors) == pytest.approx(laser.noise, rel=0.25)
        assert (np.isinf(np.frombuffer(first, "<f4")) == np.isinf(clean)).all()


def test_an_inertial_unit_feels_gravity_the_ramp_and_the_turn(spawn: Spawner, world: World) -> None:
    unit = read_model("burger").imu
    assert unit is not None
    robot = spawn()
    offset = Pose3((-0.032, 0.0, 0.078))

    def readings(states: Sequence[BodyState]) -> NDArray[np.float64]:
        """Return turn rate and specific force over two steps, for all states but the first two."""
        poses = [Pose3(each.position, each.orientation) @ offset for each in states[2:]]
        before, now = (np.array([each.numbers for each in part]) for part in (states[:-2], states[2:]))
        exact = np.zeros((len(now), 6))
        return imu_readings(unit, np.array([(*p, *q) for p, q in poses]), before, now, 2 * DT, exact)[:, 4:]

    still = readings(drive_robots([robot], 0.0, 0.0, 0.5))[-1]
    assert still[5] == pytest.approx(9.81, abs=0.02)
    assert abs(still[3]) < 0.02
    feels = readings(drive_robots([robot], 0.22, 0.0, 0.15))[:, 3]
    assert np.mean(feels) == pytest.approx(1.0, rel=0.1)
    drive_robots([robot], 0.0, 2.0, 2.0)
    turning = readings(drive_robots([robot], 0.0, 2.0, 1.0))[-1]
    assert turning[2] == pytest.approx(2.0, rel=0.004)
    assert turning[3] == pytest.approx(2.0**2 * 0.032, rel=0.1), "toward the centre"


def test_joint_states_carry_names_and_readings(spawn: Spawner, world: World) -> None:
    drive_robots([spawn()], 0.1, 0.0, 1.0)
    state = joint_state(world.body("robot").joints, world.body("robot").joint_readings(), HEADER)
    assert state.name == ("wheel_left_joint", "wheel_right_joint")
    assert state.velocity[0] == pytest.approx(0.1 / 0.033, rel=0.003)


@pytest.mark.parametrize("model", ["waffle", "waffle_pi"])
def test_a_camera_sees_the_red_wall_upright(model: str, new_world: NewWorld) -> None:
    camera = read_model(model).camera
    assert camera is not None
    low = Box(name="low", size=(0.2, 8.0, 0.2), position=(2.1, 0.0, 0.1), colour=(1.0, 0.0, 0.0, 1.0))
    with new_world(WorldDescription(boxes=(low,))) as world:
        world.spawn(robot_body("robot", model, placement_at(0.0, 0.0)))
        shot = camera_image(world, "robot", camera, HEADER)
    pixels = np.frombuffer(shot.data, np.uint8).reshape(shot.height, shot.width, 3).astype(int)
    red = (pixels[:, :, 0] > 80) & (pixels[:, :, 1] < pixels[:, :, 0] // 2)
    rows, columns = np.nonzero(red)
    assert len(set(columns)) == camera.width, "from edge to edge"
    eye, focal = 0.117 if model == "waffle" else 0.103, camera_info(camera, HEADER).k[0]
    assert rows.min() < camera.height / 2 < rows.max() + 40
    assert rows.min() == pytest.approx(camera.height / 2 - focal * (0.2 - eye) / 1.92, abs=3)
