"""Drive settings from parameters and model: the model's defaults, overrides, warnings and errors."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Any

import msgspec
import pytest

from models import WHEELED, model_config_path
from models.model import RobotModel, read_model
from services.driving.pid import PidGains
from services.runtime.errors import BadInput
from services.sim.drive.config import DriveConfig, drive_config, effective_parameters, odometry_config
from services.sim.drive.kinematics import WheelGeometry
from services.sim.drive.limiter import AxisLimits
from tests.services.sim.drive.simulation_harness import base_parameters, run_simulation
from tests.services.sim.physics.driven_robot import ramped_drive


def settings(name: str, **parameters: Any) -> DriveConfig:
    model = read_model(name)
    assert model.wheels is not None
    return drive_config(name, model, effective_parameters(name, model, base_parameters(**parameters)))


@pytest.mark.parametrize("name", WHEELED)
def test_every_model_fits_its_urdf(name: str) -> None:
    assert settings(name).warnings == ()


@pytest.mark.parametrize("name", ["burger", "waffle", "waffle_pi"])
def test_a_turtlebot_is_driven_as_its_plugin_does(name: str) -> None:
    wheels = read_model(name).wheels
    assert wheels is not None
    assert settings(name).drive == ramped_drive(wheels)
    assert settings(name, clamp=False, jump=0.01).drive == ramped_drive(wheels, clamp=False, jump=0.01)
    assert odometry_config(read_model(name), base_parameters()).source == "encoder", "as the real one's, not Gazebo's"
    assert odometry_config(read_model(name), base_parameters(odometry="world")).source == "world"


def test_the_pioneer_is_driven_as_its_packages_do() -> None:
    made = settings("p3dx")
    assert made.drive.linear == AxisLimits(-0.75, 0.75, 0.3, 0.3, 0.3, 0.3)
    assert made.drive.angular == AxisLimits(-1.745329, 1.745329, *[1.745329] * 4)
    assert (made.drive.stop_linear.decelerate, made.drive.stop_linear.decelerate_reverse) == (1.5, 1.5)
    assert made.drive.stop_angular.decelerate == pytest.approx(1.5 / 0.165)
    assert made.drive.ramp.acceleration == inf
    assert odometry_config(read_model("p3dx"), base_parameters()).source == "encoder"


def test_a_fleet_wins_over_the_model_field_by_field() -> None:
    made = settings("p3dx", linear={"max_velocity": 0.5}, brake=2, publish_rate=10)
    assert (made.drive.linear.max_velocity, made.drive.linear.accelerate) == (0.5, 0.3)
    assert made.drive.stop_linear.decelerate == 2
    assert made.live.publish_rate == 10


def test_limits_in_the_words_of_ros1_and_ros2() -> None:
    ros1 = settings("p3dx", linear={"max_acceleration": 1, "min_acceleration": -2, "min_velocity": -0.1})
    assert ros1.drive.linear == AxisLimits(-0.1, 0.75, 1, 2, 2, 1)
    four = {
        "max_acceleration": 1,
        "max_deceleration": -2,
        "max_acceleration_reverse": -3,
        "max_deceleration_reverse": 4,
    }
    assert settings("p3dx", linear=four).drive.linear == AxisLimits(-0.75, 0.75, 1, 2, 3, 4)
    jerk = settings("p3dx", linear={"max_jerk": 5}, jerk_rule="ros1").drive.linear
    assert (jerk.min_jerk, jerk.max_jerk, jerk.ros1_jerk) == (-5, 5, True)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"linear": {"min_velocity": 0.1}}, r"linear\.min_velocity = 0\.1: .* <= 0"),
        ({"angular": {"max_velocity": -1}}, r"angular\.max_velocity = -1: .* >= 0"),
        ({"linear": {"max_acceleration": 0}}, r"linear\.max_acceleration = 0: .* > 0"),
        ({"linear": {"min_acceleration": 1}}, r"linear\.min_acceleration = 1: .* < -?0"),
        ({"linear": {"max_deceleration": 0}}, r"linear\.max_deceleration = 0: .* never change its speed"),
        ({"angular": {"min_jerk": 1}}, r"angular\.min_jerk = 1: .* < -?0"),
        (
            {"keep_curvature": True, "linear": {"max_jerk": 5}},
            "keep_curvature = True and linear.max_jerk = 5.0 exclude each other",
        ),
        ({"ramp": "wheels", "brake_angular": 1}, 'brake_angular needs ramp = "base"'),
        ({"left_wheel": "base_right_wheel_joint"}, "are both 'base_right_wheel_joint'"),
    ],
)
def test_what_contradicts_itself_is_refused(parameters: dict[str, Any], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        settings("p3dx", **parameters)


@pytest.mark.parametrize(
    "parameters",
    [
        {"wheel_radius": 0.0},
        {"wheel_separation_multiplier": 10.1},
        {"publish_rate": 51},
        {"pose_covariance_diagonal": [1, 2, 3]},
        {"twist_covariance_diagonal": [1, 2, 3, 4, 5, -6]},
        {"velocity_rolling_window_size": 0},
        {"linear": {"max_speed": 1}},
        {"wheel_pid": {"i": 1}},
        {"brake": 0},
        {"linear": {"max_velocity": float("nan")}},
    ],
)
def test_what_is_out_of_bounds_is_refused(parameters: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match=next(iter(parameters))):
        base_parameters(**parameters)


def test_the_tutorials_figures_warn_and_do_what_is_said() -> None:
    """On the real robot's geometry: 0.65 of the speed, 0.77 of the turn rate; odometry assumes the command."""
    with run_simulation(wheel_radius=0.15, wheel_separation=0.39) as world:
        assert "drives x0.65 the commanded speed and turns x0.77 the commanded rate" in world.log
        assert "reports x1.54 the way and x1.30 the turn" in world.log
        world.drive(0.4, 0.0, 3.0)
        assert world.truth().twist.twist.linear.x == pytest.approx(0.4 * 0.65, rel=5e-3)
        world.drive(0.0, 0.8, 4.0)
        assert world.truth().twist.twist.angular.z == pytest.approx(0.8 * 0.65 * 0.39 / 0.33, rel=5e-3)


EXCHANGED = {"left_wheel": "base_right_wheel_joint", "right_wheel": "base_left_wheel_joint"}


def test_exchanged_wheels_are_refused() -> None:
    says = r"p3dx: left_wheel 'base_right.*on the robot's right.*allow_swapped_wheels = true"
    with pytest.raises(BadInput, match=says), run_simulation(**EXCHANGED):
        raise AssertionError("it was spawned")


def test_exchanged_wheels_that_are_forced_turn_the_wrong_way_and_odometry_cannot_see_it() -> None:
    with run_simulation(allow_swapped_wheels=True, **EXCHANGED) as world:
        assert "WARN /sim: p3dx: left_wheel 'base_right_wheel_joint' stands on the robot's right" in world.log
        world.drive(0.0, 0.5, 2.0)
        assert world.truth().twist.twist.angular.z == pytest.approx(-0.5, rel=5e-3)
        assert world.robot.publishers.odometer.state is not None
        assert world.robot.publishers.odometer.state.w == pytest.approx(0.5, rel=5e-3)


def test_multipliers_and_the_one_for_both() -> None:
    one = settings("p3dx", left_wheel_radius_multiplier=0.99, right_wheel_radius_multiplier=1.01)
    assert one.drive.geometry == WheelGeometry(0.33, 0.0975 * 0.99, 0.0975 * 1.01)
    both = settings("p3dx", left_wheel_radius_multiplier=0.5, wheel_radius_multiplier=1.01)
    assert both.drive.geometry == WheelGeometry(0.33, 0.0975 * 1.01, 0.0975 * 1.01)
    assert both.geometry == WheelGeometry(0.33, 0.0975, 0.0975)


def test_gains_clamp_the_integral_as_ros_does() -> None:
    made = settings("p3dx", wheel_pid={"p": 5, "i": 1, "i_clamp": 2, "i_clamp_max": 3, "antiwindup": True})
    assert made.gains == PidGains(5, 1, 0, -2, 3, True, 2.0)
    assert made.warnings == ()


def test_a_model_may_leave_its_wheels_to_the_urdf_and_nothing_to_a_fleet_s_part(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    table = tmp_path / "model.toml"
    text = model_config_path("p3dx").read_text().replace("separation = 0.33\n", "").replace("\nradius = 0.0975", "")
    table.write_text(text)
    monkeypatch.setattr("models.model.model_config_path", lambda _: table)
    wheels = read_model("p3dx").wheels
    assert wheels is not None
    assert (wheels.separation, wheels.radius) == pytest.approx((0.33, 0.0975))
    model = msgspec.structs.replace(read_model("p3dx"), drive={"noise": False})
    with pytest.raises(BadInput, match=r"\[drive\]: noise belongs in a fleet file"):
        effective_parameters("p3dx", model, base_parameters())
    with pytest.raises(BadInput, match=r"\[drive\]: unknown parameter 'brakes'; did you mean 'brake'"):
        effective_parameters("p3dx", msgspec.structs.replace(model, drive={"brakes": 1}), base_parameters())


def test_a_body_without_wheels_has_the_odometry_of_the_world() -> None:
    bare: RobotModel = msgspec.structs.replace(read_model("p3dx"), wheels=None)
    assert odometry_config(bare, base_parameters(open_loop=True)).source == "world"
