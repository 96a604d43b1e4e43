"""Imported robots in the simulation: the commands that they obey, topic names, and what they publish."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from messages.geometry import Twist, Vector3
from messages.se3 import Pose3
from messages.sensor import Imu, LaserScan
from messages.topics import CMD_VEL, GROUND_TRUTH, IMU, ODOM, SCAN
from models.model import read_model
from models.robot_source import resolve_robot
from services.runtime.errors import BadInput
from services.sim.engines import ENGINES, Engine, has_engine
from services.sim.robot_loader import on_the_ground
from tests.models import robots
from tests.models.sample_robots import car, write
from tests.services.sim.drive.simulation_harness import SimulationHarness, run_simulation

FOLDER = Path(robots.__file__).parent


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def model_of(name: str) -> str:
    return resolve_robot(f"{name}.urdf", FOLDER).model


def position(on: SimulationHarness) -> tuple[float, float]:
    place = on.latest(GROUND_TRUTH).pose.pose.position
    return place.x, place.y


@pytest.mark.parametrize("engine", [each for each in ENGINES if has_engine(each)])
def test_a_holonomic_base_obeys_all_three_and_brakes_alone(engine: Engine) -> None:
    with run_simulation(model_of("glider"), engine=engine) as on:
        for _ in range(50):
            on.publish(CMD_VEL, Twist(linear=Vector3(x=0.2, y=-0.3), angular=Vector3(z=0.5)))
            on.run(0.04)
        moving = on.latest(ODOM).twist.twist
        assert (moving.linear.x, moving.linear.y, moving.angular.z) == pytest.approx((0.2, -0.3, 0.5), abs=2e-3)
        on.run(1.0)
        assert on.latest(GROUND_TRUTH).pose.pose.position.z == pytest.approx(0.0, abs=1e-3), "on its wheels"
        twist = on.latest(GROUND_TRUTH).twist.twist
        assert (twist.linear.x, twist.linear.y, twist.angular.z) == pytest.approx((0, 0, 0), abs=1e-6)
        assert on.status().timed_out


def test_an_emergency_stop_holds_a_holonomic_base() -> None:
    with run_simulation(model_of("glider")) as on:
        on.drive(0.5, 0.0, 1.0)
        on.robot.stop(("/someone",), new_stop=True)
        on.drive(0.5, 0.0, 1.0)
        before = position(on)
        on.drive(0.5, 0.0, 0.4)
        assert position(on) == pytest.approx(before, abs=1e-6)


def test_figures_of_wheels_are_none_of_a_holonomic_base() -> None:
    for parameters in ({"ramp": "wheels"}, {"linear": {"max_jerk": 1.0}}):
        with pytest.raises(BadInput, match="holonomic base"), run_simulation(model_of("glider"), **parameters):
            pass


def test_a_skid_steer_obeys_the_name_of_its_tag_and_ours() -> None:
    own = CMD_VEL.named("base/cmd_vel")
    with run_simulation(model_of("ranger")) as on:
        on.subscribe(ODOM.named("base/odom"))
        for topic, heading in ((own, 0.6), (CMD_VEL, 1.2)):
            for _ in range(25):
                on.publish(topic, Twist.planar(0.0, 0.5))
                on.run(0.04)
            on.run(1.0)
            pose = on.latest(GROUND_TRUTH).pose.pose.orientation
            assert 2 * math.atan2(pose.z, pose.w) == pytest.approx(heading, abs=0.05), "1 s, and the time-out"
        assert on.received(ODOM.named("base/odom"))[-1] == on.latest(ODOM)


def test_wheels_in_mirror_image_are_driven_and_counted_ahead(tmp_path: Path) -> None:
    text = (FOLDER / "courier.urdf").read_text()
    right = text[text.index('<joint name="right_wheel_joint"') :]
    bare = text.replace(right, right.replace('<axis xyz="0 0 -1"/>', '<axis xyz="0 0 1"/>', 1))
    own = tmp_path / "mirrored.urdf"
    own.write_text(bare[: bare.index("  <gazebo")] + "</robot>")
    model = resolve_robot(str(own), tmp_path).model
    wheels = read_model(model).wheels
    assert wheels is not None
    assert wheels.reversed == ("right_wheel_joint",)
    for gains in ({}, {"wheel_pid": {"p": 2.0}}):
        with run_simulation(model, on_the_ground(model, Pose3()), **gains) as on:
            on.drive(0.3, 0.0, 2.0)
            truth = position(on)
            assert truth == pytest.approx((0.55, 0.0), abs=0.05), gains
            counted = on.latest(ODOM).pose.pose.position
            assert (counted.x, counted.y) == pytest.approx(truth, abs=0.01), gains


def test_a_car_turns_as_commanded_and_counts_it(tmp_path: Path) -> None:
    model = resolve_robot(str(write(tmp_path / "car.urdf", car((0.2, -0.2)))), tmp_path).model
    with run_simulation(model, on_the_ground(model, Pose3())) as on:
        on.drive(0.3, 0.15, 4.0)
        twist = on.latest(GROUND_TRUTH).twist.twist
        assert (twist.linear.x, twist.angular.z) == pytest.approx((0.3, 0.15), abs=0.01)
        counted = on.latest(ODOM).pose.pose.position
        assert (counted.x, counted.y) == pytest.approx(position(on), abs=0.02)
        assert position(on)[1] > 0.05, "to the left"
        on.drive(0.0, 0.5, 2.0)
        stood = position(on)
        on.drive(0.0, 0.5, 1.0)
        assert position(on) == pytest.approx(stood, abs=1e-3), "no car turns on the spot"


def test_the_sensors_of_tags_are_where_their_links_are() -> None:
    model = model_of("courier")
    with run_simulation(model, on_the_ground(model, Pose3())) as on:
        on.subscribe(SCAN)
        on.subscribe(IMU)
        on.run(1.0)
        scan, imu = on.latest(SCAN), on.latest(IMU)
        assert isinstance(scan, LaserScan)
        assert isinstance(imu, Imu)
        assert scan.header.frame_id == "p3dx/lidar_link"
        assert len(scan.ranges) == 181
        assert all(math.isinf(each) for each in scan.ranges), "it does not see its own housing"
        assert 2 * math.atan2(imu.orientation.z, imu.orientation.w) == pytest.approx(math.pi / 2, abs=1e-3), (
            "its link is turned by 90 degrees"
        )
        assert on.latest(ODOM).header.frame_id == "p3dx/odom_wheels"
        assert on.latest(ODOM).child_frame_id == "p3dx/base_link"
