"""The configuration of a base's drive, from the model and a robot's parameters, checked against the URDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any, Literal

import msgspec

from messages.base import Packed36, covariance
from models import model_config_path, urdf_path
from models.model import OdometryErrorConfig, PlanarConfig, RobotModel, WheelConfig, read_model
from models.robot_cache import is_imported
from models.robot_facts import read_facts
from models.urdf import NoWheels, WheelPair, read_wheels
from services.driving.pid import PidGains
from services.runtime.errors import BadInput
from services.runtime.parameters.validation import build
from services.sim.drive.driver import Drive
from services.sim.drive.kinematics import WheelGeometry, describe_mismatch
from services.sim.drive.limiter import NO_RAMP, UNLIMITED, AxisLimits, WheelRamp, braking_limits
from services.sim.drive.steering import Steering
from services.sim.parameters import AxisParameters, BaseParameters, PidParameters
from services.sim.physics.world import Motor


@dataclass(frozen=True)
class LiveParameters:
    """The live parameters of ROS's ``diff_drive_controller``.

    Multipliers of the configured geometry; ``publish_rate`` [Hz] of odometry, 0 for none; ``enable_odom_tf``: whether
    odometry is also published on ``/tf``.
    """

    wheel_separation_multiplier: float = 1.0
    left_wheel_radius_multiplier: float = 1.0
    right_wheel_radius_multiplier: float = 1.0
    publish_rate: float = 50.0
    enable_odom_tf: bool = True


DEFAULT_WINDOW = 2
"""Control ticks over which odometry averages its speed: 2 as in the tutorials; ROS's default of 10 lags by 0.1 s."""


NO_TIMEOUT = (
    "cmd_vel_timeout = 0: a command holds until the next one, or until its sender has left the network; a sender that "
    "hangs does not stop the robot. A zero command or an emergency stop does"
)
"""The warning about a base without a time-out."""


@dataclass(frozen=True)
class DriveConfig:
    """The full configuration of a base driver. ``geometry`` is without multipliers; ``drive`` has those of ``live``.

    All wheels of one side turn at the same rate, ``reversed`` ones in the opposite sense; a holonomic base drives none.
    """

    left_joints: tuple[str, ...]
    right_joints: tuple[str, ...]
    torque: float
    geometry: WheelGeometry
    drive: Drive
    live: LiveParameters
    gains: PidGains | None
    timeout: float
    exclusive: bool
    stamped: bool
    publish_cmd: bool
    warnings: tuple[str, ...] = ()
    reversed: tuple[str, ...] = ()
    steering_torque: float = 0.0

    @property
    def motors(self) -> tuple[Motor, ...]:
        """The motors of the wheels, left ones first, and of the steering joints."""
        wheels = tuple(Motor(joint, self.torque) for joint in (*self.left_joints, *self.right_joints))
        steering = self.drive.steering
        steered = () if steering is None else tuple(Motor(each.joint, self.steering_torque) for each in steering.wheels)
        return wheels + steered

    def per_wheel(self, sides: tuple[float, float]) -> tuple[float, ...]:
        """Return a value for each driven wheel, left ones first, from the values of the two sides."""
        values = (sides[0],) * len(self.left_joints) + (sides[1],) * len(self.right_joints)
        if not self.reversed:
            return values
        joints = (*self.left_joints, *self.right_joints)
        return tuple(-each if joint in self.reversed else each for joint, each in zip(joints, values, strict=True))

    def side_means(self, by_joint: Mapping[str, float]) -> tuple[float, float]:
        """Return the mean values of the two sides, positive ahead, from those of the joints."""
        return _mean_of(by_joint, self.left_joints, self.reversed), _mean_of(by_joint, self.right_joints, self.reversed)


@dataclass(frozen=True)
class OdometryConfig:
    """The source of odometry, and its covariances; None for the default of its source.

    Counted odometry starts at the robot's pose in the world with ``in_world``, else at 0. ``error_multiple`` multiplies
    ``error``, the standard deviations of the wheel radii and separation.
    """

    source: Literal["world", "encoder", "open loop"]
    in_world: bool
    error: OdometryErrorConfig
    error_multiple: float
    window: int
    pose: Packed36 | None
    twist: Packed36 | None


_DEFAULTS = BaseParameters()


def effective_parameters(name: str, model: RobotModel, stated: BaseParameters) -> BaseParameters:
    """Return ``stated``, with the model's ``[drive]`` where it has None; raises BadInput for a bad file."""
    where = f"{model_config_path(name)}: [drive]"
    ours = build(BaseParameters, model.drive, where)
    for each in model.drive:
        if getattr(_DEFAULTS, each) is not None:
            raise BadInput(f"{where}: {each} belongs in a fleet file, not in a model")
    merged: BaseParameters = _merged(ours, stated)
    return with_model_defaults(model, merged)


def with_model_defaults(model: RobotModel, parameters: BaseParameters) -> BaseParameters:
    """Fill in the effective values where the parameters have None, as far as there is a single one."""
    wheels, base = model.wheels, model.wheels or model.planar
    if base is None:
        return parameters
    defaults: dict[str, Any] = {
        "ramp": "base" if wheels is None or wheels.steering is not None else "wheels",
        "jerk_rule": "ros2",
        "keep_curvature": False,
        "brake": base.brake,
        "allow_multiple_cmd_vel_publishers": True,
        "use_stamped_vel": False,
        "publish_cmd": False,
        "open_loop": False,
        "velocity_rolling_window_size": DEFAULT_WINDOW,
        "publish_rate": model.odometry_rate,
        "enable_odom_tf": True,
    }
    if wheels is not None:
        defaults |= {
            "left_wheel": wheels.left_joint,
            "right_wheel": wheels.right_joint,
            "wheel_separation": wheels.separation,
            "wheel_radius": wheels.radius,
            "wheel_separation_multiplier": 1.0,
            "left_wheel_radius_multiplier": 1.0,
            "right_wheel_radius_multiplier": 1.0,
        }
    missing = {name: value for name, value in defaults.items() if getattr(parameters, name) is None}
    return msgspec.structs.replace(parameters, **missing)


@dataclass(frozen=True)
class RobotConfig:
    """A model, the effective parameters of its base, and its drive configuration; None without a base."""

    model: RobotModel
    parameters: BaseParameters
    drive_config: DriveConfig | None


def robot_config(name: str, stated: BaseParameters) -> RobotConfig:
    """Return the configuration of a robot of the model ``name`` with the parameters of a fleet; raises BadInput."""
    model = read_model(name)
    parameters = effective_parameters(name, model, stated)
    return RobotConfig(model, parameters, drive_config(name, model, parameters) if model.has_base else None)


def odometry_config(model: RobotModel, parameters: BaseParameters) -> OdometryConfig:
    """Return the configuration of a robot's odometry; without wheels it is the true pose in the world."""
    chosen = model.odometry if parameters.odometry == "model" else parameters.odometry
    source: Literal["world", "encoder", "open loop"] = chosen if model.wheels is not None else "world"
    if parameters.open_loop and model.wheels is not None:
        source = "open loop"
    pose, twist = parameters.pose_covariance_diagonal, parameters.twist_covariance_diagonal
    return OdometryConfig(
        source=source,
        in_world=(model.odometry_origin if parameters.odometry_origin == "model" else parameters.odometry_origin)
        == "world",
        error=model.odometry_error,
        error_multiple=parameters.odometry_error,
        window=parameters.velocity_rolling_window_size or DEFAULT_WINDOW,
        pose=None if pose is None else covariance(*pose),
        twist=None if twist is None else covariance(*twist),
    )


def drive_config(name: str, model: RobotModel, parameters: BaseParameters) -> DriveConfig:
    """Return the configuration of a robot's drive, from the effective ``parameters``.

    Raises:
        BadInput: The parameters contradict each other, or left and right wheels are exchanged.
    """
    wheels, live = model.wheels, _live_parameters(model, parameters)
    common: dict[str, Any] = {
        "live": live,
        "timeout": parameters.cmd_vel_timeout,
        "exclusive": parameters.allow_multiple_cmd_vel_publishers is False,
        "stamped": bool(parameters.use_stamped_vel),
        "publish_cmd": bool(parameters.publish_cmd),
    }
    if wheels is None:
        assert model.planar is not None
        geometry = WheelGeometry(2 * model.radius, 1.0, 1.0)
        drive = _planar_drive(model.planar, parameters, geometry)
        return DriveConfig((), (), 0.0, geometry, drive, gains=None, **common)
    left, right = parameters.left_wheel or wheels.left_joint, parameters.right_wheel or wheels.right_joint
    radius = parameters.wheel_radius or wheels.radius
    geometry = WheelGeometry(parameters.wheel_separation or wheels.separation, radius, radius)
    turned = apply_multipliers(_drive(wheels, parameters, geometry), geometry, live)
    gains = pid_gains(parameters.wheel_pid, wheels.torque)
    idle = (
        []
        if gains is None or not gains.i or gains.i_min < gains.i_max
        else ["wheel_pid: i has no effect while i_clamp is 0, which is also its default in ROS"]
    )
    return DriveConfig(
        left_joints=(left, *wheels.other_left),
        right_joints=(right, *wheels.other_right),
        torque=wheels.torque,
        geometry=geometry,
        drive=turned,
        gains=gains,
        warnings=(
            *_check_against_urdf(name, left, right, turned.geometry, parameters),
            *idle,
            *([] if parameters.cmd_vel_timeout else [NO_TIMEOUT]),
        ),
        reversed=wheels.reversed,
        steering_torque=0.0 if wheels.steering is None else wheels.steering.torque,
        **common,
    )


def apply_multipliers(drive: Drive, geometry: WheelGeometry, live: LiveParameters) -> Drive:
    """Return the drive with the multipliers of ``live`` applied to the configured ``geometry``."""
    made = geometry.scaled(
        live.wheel_separation_multiplier, live.left_wheel_radius_multiplier, live.right_wheel_radius_multiplier
    )
    return replace(drive, geometry=made)


def _live_parameters(model: RobotModel, parameters: BaseParameters) -> LiveParameters:
    both = parameters.wheel_radius_multiplier
    rate, tf = parameters.publish_rate, parameters.enable_odom_tf
    return LiveParameters(
        wheel_separation_multiplier=parameters.wheel_separation_multiplier or 1.0,
        left_wheel_radius_multiplier=both or parameters.left_wheel_radius_multiplier or 1.0,
        right_wheel_radius_multiplier=both or parameters.right_wheel_radius_multiplier or 1.0,
        publish_rate=model.odometry_rate if rate is None else rate,
        enable_odom_tf=tf is not False,
    )


def _drive(wheels: WheelConfig, parameters: BaseParameters, geometry: WheelGeometry) -> Drive:
    of_base = parameters.ramp == "base"
    if wheels.steering is not None and (not of_base or parameters.wheel_pid is not None):
        raise BadInput('a base with steered wheels drives as a whole: ramp = "wheels" and wheel_pid are for others')
    around = geometry.separation / 2
    rise = wheels.acceleration if of_base else None
    fastest = (wheels.max_linear, wheels.max_angular) if parameters.clamp else (None, None)
    ros1 = parameters.jerk_rule == "ros1"
    linear = axis_limits("linear", parameters.linear, fastest[0], rise, ros1)
    angular = axis_limits("angular", parameters.angular, fastest[1], rise and rise / around, ros1)
    brake = parameters.brake or wheels.brake
    keep = bool(parameters.keep_curvature)
    if keep and (linear.limits_jerk or angular.limits_jerk):
        raise BadInput("keep_curvature slows one axis for the other, which a jerk limit does not allow: leave one out")
    if not of_base:
        if parameters.brake_angular is not None:
            raise BadInput(
                'brake_angular needs ramp = "base": with ramp = "wheels", each wheel brakes at the rate brake'
            )
        return Drive(
            geometry,
            linear,
            angular,
            UNLIMITED,
            UNLIMITED,
            WheelRamp(wheels.acceleration, brake, parameters.jump),
            keep,
        )
    stop_angular = braking_limits(angular, parameters.brake_angular or brake / around)
    steering = None if wheels.steering is None else Steering.of(wheels.steering)
    stop_linear = braking_limits(linear, brake)
    return Drive(geometry, linear, angular, stop_linear, stop_angular, NO_RAMP, keep, steering=steering)


def _planar_drive(planar: PlanarConfig, parameters: BaseParameters, geometry: WheelGeometry) -> Drive:
    if parameters.ramp == "wheels" or parameters.wheel_pid is not None:
        raise BadInput('a holonomic base supports neither ramp = "wheels" nor wheel_pid')
    fastest = (planar.max_linear, planar.max_angular) if parameters.clamp else (None, None)
    ros1 = parameters.jerk_rule == "ros1"
    linear = axis_limits("linear", parameters.linear, fastest[0], planar.acceleration, ros1)
    angular = axis_limits("angular", parameters.angular, fastest[1], planar.acceleration_angular, ros1)
    if linear.limits_jerk:
        raise BadInput("linear: a holonomic base has no jerk limit")
    brake = parameters.brake or planar.brake
    stop_angular = braking_limits(angular, parameters.brake_angular or brake / (geometry.separation / 2))
    keep = bool(parameters.keep_curvature)
    return Drive(geometry, linear, angular, braking_limits(linear, brake), stop_angular, NO_RAMP, keep, holonomic=True)


def _check_against_urdf(name: str, left: str, right: str, used: WheelGeometry, parameters: BaseParameters) -> list[str]:
    """Return warnings about values and wheels that do not match the URDF; raises BadInput for fatal ones."""
    urdf = urdf_path(name)
    try:
        pair = read_wheels(urdf, left, right)
    except NoWheels as error:
        raise BadInput(f"{urdf}: {error}") from None
    if left == right:
        raise BadInput(f"left_wheel and right_wheel are both {left!r}: a base has one on each side")
    warnings = _check_sides(pair, left, right, parameters.allow_swapped_wheels)
    if is_imported(name) and (built := read_facts(name).wheels) is not None:
        wrong = describe_mismatch(used, WheelGeometry(built.track, built.left_radius, built.right_radius))
        return [*warnings, wrong] if wrong else warnings
    if pair.left_radius is None or pair.right_radius is None:
        return [
            *warnings,
            f"{urdf}: the wheels have no collision sphere or cylinder, so radius and separation are not checked",
        ]
    wrong = describe_mismatch(used, WheelGeometry(pair.separation, pair.left_radius, pair.right_radius))
    return [*warnings, wrong] if wrong else warnings


def _check_sides(pair: WheelPair, left: str, right: str, allowed: bool) -> list[str]:
    if pair.left_offset >= pair.right_offset:
        return []
    text = (
        f"left_wheel {left!r} stands on the robot's right (y = {pair.left_offset:.3f} m), right_wheel {right!r} on its "
        f"left (y = {pair.right_offset:.3f} m): the base turns the wrong way, and its wheel odometry does not show it"
    )
    if not allowed:
        raise BadInput(f"{text}. Swap the two names, or set allow_swapped_wheels = true if this is intended")
    return [text]


def _mean_of(by_joint: Mapping[str, float], joints: tuple[str, ...], turned: tuple[str, ...]) -> float:
    total = 0.0
    for each in joints:  # sum() rounds otherwise from Python 3.12 on
        total += -by_joint[each] if each in turned else by_joint[each]
    return total / len(joints)


def _merged(ours: Any, stated: Any) -> Any:
    """Return ``stated`` with the fields of ``ours`` where it has None; tables are merged field by field."""
    fields = {}
    for name in stated.__struct_fields__:
        mine, theirs = getattr(ours, name), getattr(stated, name)
        if theirs is None:
            theirs = mine
        elif isinstance(theirs, msgspec.Struct) and mine is not None:
            theirs = _merged(mine, theirs)
        fields[name] = theirs
    return type(stated)(**fields)


def axis_limits(
    name: str, stated: AxisParameters | None, fastest: float | None, rise: float | None, ros1_jerk: bool = False
) -> AxisLimits:
    """Return the limits of the axis ``name``; raises BadInput for a deceleration of 0.

    The hardware's speed ``fastest`` caps the stated limits; ``rise`` is the acceleration if none is stated.
    """
    limits = stated or AxisParameters()
    most = inf if fastest is None else fastest
    high = _default(limits.max_velocity, inf)
    low = _default(limits.min_velocity, -high)
    up = _default(limits.max_acceleration, inf if rise is None else rise)
    down = -_default(limits.min_acceleration, -up)
    jerk = _default(limits.max_jerk, inf)
    return AxisLimits(
        min_velocity=max(low, -most),
        max_velocity=min(high, most),
        accelerate=up,
        decelerate=_magnitude(name, "max_deceleration", limits.max_deceleration, down),
        accelerate_reverse=_magnitude(name, "max_acceleration_reverse", limits.max_acceleration_reverse, down),
        decelerate_reverse=_magnitude(name, "max_deceleration_reverse", limits.max_deceleration_reverse, up),
        min_jerk=_default(limits.min_jerk, -jerk),
        max_jerk=jerk,
        ros1_jerk=ros1_jerk,
    )


def pid_gains(stated: PidParameters | None, limit: float) -> PidGains | None:
    """Return the gains of a wheel whose torque is at most ``limit`` [N m]; None for one driven by speed."""
    if stated is None:
        return None
    low = -stated.i_clamp if stated.i_clamp_min is None else stated.i_clamp_min
    high = stated.i_clamp if stated.i_clamp_max is None else stated.i_clamp_max
    return PidGains(stated.p, stated.i, stated.d, low, high, stated.antiwindup, limit)


def _default(value: float | None, default: float) -> float:
    return default if value is None else value


def _magnitude(axis: str, name: str, value: float | None, default: float) -> float:
    if value == 0:
        raise BadInput(f"{axis}.{name} = 0: a base with this limit could never change its speed")
    return default if value is None else abs(value)
