"""From a model's figures and a robot's parameters to what its base driver works with, checked against the URDF."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from messages.base import Packed36, covariance
from models import figures_path, model_path
from models.figures import Model, Wheels, read_model
from models.wheels import NoWheels, WheelPair, read_wheels
from services.runtime.errors import BadInput
from services.runtime.parameters.record import build
from services.sim import BaseParameters
from services.sim.base.axes import axis_of, gains_of
from services.sim.diffdrive.driver import Drive
from services.sim.diffdrive.geometry import Geometry, mismatch
from services.sim.diffdrive.limiter import FREE, braking
from services.sim.diffdrive.live import Live
from services.sim.diffdrive.pid import Gains
from services.sim.diffdrive.ramp import NO_RAMP, Ramp

WINDOW = 2
"""Control ticks in the mean of odometry's speed: that of the seeds; ROS's default of 10 lags by 0.1 s."""


@dataclass(frozen=True)
class Settings:
    """Everything that a base driver is set to. ``geometry`` is without multipliers; ``drive`` has those of ``live``."""

    left_joint: str
    right_joint: str
    torque: float
    geometry: Geometry
    drive: Drive
    live: Live
    gains: Gains | None
    timeout: float
    exclusive: bool
    stamped: bool
    publish_cmd: bool
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class OdometrySettings:
    """Where odometry comes from, and what is said of it; a covariance of None is that of its source."""

    source: Literal["world", "encoder", "open loop"]
    window: int
    pose: Packed36 | None
    twist: Packed36 | None


def effective(name: str, model: Model, given: BaseParameters) -> BaseParameters:
    """What is ``given``, completed by the model's ``[drive]`` where it is None; raises BadInput for a bad file."""
    where = f"{figures_path(name)}: [drive]"
    ours = build(BaseParameters, model.drive, where)
    for each in msgspec.structs.fields(BaseParameters):
        if each.name in model.drive and each.default is not None:
            raise BadInput(f"{where}: {each.name} is for a fleet to say, not for a model")
    merged: BaseParameters = _merged(ours, given)
    return completed(model, merged)


def completed(model: Model, parameters: BaseParameters) -> BaseParameters:
    """The parameters with the figures that count where they have None, as far as a single one does."""
    wheels = model.wheels
    if wheels is None:
        return parameters
    own = {
        "left_wheel": wheels.left_joint,
        "right_wheel": wheels.right_joint,
        "wheel_separation": wheels.separation,
        "wheel_radius": wheels.radius,
        "wheel_separation_multiplier": 1.0,
        "left_wheel_radius_multiplier": 1.0,
        "right_wheel_radius_multiplier": 1.0,
        "ramp": "wheels",
        "jerk_rule": "ros2",
        "keep_curvature": False,
        "brake": wheels.brake,
        "allow_multiple_cmd_vel_publishers": True,
        "use_stamped_vel": False,
        "publish_cmd": False,
        "open_loop": False,
        "velocity_rolling_window_size": WINDOW,
        "publish_rate": model.odometry_rate,
        "enable_odom_tf": True,
    }
    missing = {name: value for name, value in own.items() if getattr(parameters, name) is None}
    return msgspec.structs.replace(parameters, **missing)


@dataclass(frozen=True)
class Configured:
    """A model, the effective parameters of its base, and what its driver works with; None without wheels."""

    model: Model
    parameters: BaseParameters
    settings: Settings | None


def configured(name: str, given: BaseParameters) -> Configured:
    """How a robot of the model ``name`` is driven when a fleet gives these parameters; raises BadInput."""
    model = read_model(name)
    parameters = effective(name, model, given)
    wheels = model.wheels
    return Configured(model, parameters, base_settings(name, model, wheels, parameters) if wheels else None)


def odometry_settings(model: Model, parameters: BaseParameters) -> OdometrySettings:
    """How the odometry of a robot is made; one without wheels has that of the world."""
    chosen = model.odometry if parameters.odometry == "model" else parameters.odometry
    source: Literal["world", "encoder", "open loop"] = chosen if model.wheels is not None else "world"
    if parameters.open_loop and model.wheels is not None:
        source = "open loop"
    pose, twist = parameters.pose_covariance_diagonal, parameters.twist_covariance_diagonal
    return OdometrySettings(
        source=source,
        window=parameters.velocity_rolling_window_size or WINDOW,
        pose=None if pose is None else covariance(*pose),
        twist=None if twist is None else covariance(*twist),
    )


def base_settings(name: str, model: Model, wheels: Wheels, parameters: BaseParameters) -> Settings:
    """How the base of a robot is driven. ``parameters`` are the effective ones; raises BadInput for what contradicts
    itself, and for wheels that are exchanged."""
    left, right = parameters.left_wheel or wheels.left_joint, parameters.right_wheel or wheels.right_joint
    radius = parameters.wheel_radius or wheels.radius
    geometry = Geometry(parameters.wheel_separation or wheels.separation, radius, radius)
    live = _live(model, parameters)
    drive = _drive(wheels, parameters, geometry)
    turned = scaled(drive, geometry, live)
    gains = gains_of(parameters.wheel_pid, wheels.torque)
    idle = (
        []
        if gains is None or not gains.i or gains.i_min < gains.i_max
        else ["wheel_pid: i does nothing while i_clamp is 0, its default in ROS, too"]
    )
    return Settings(
        left_joint=left,
        right_joint=right,
        torque=wheels.torque,
        geometry=geometry,
        drive=turned,
        live=live,
        gains=gains,
        timeout=parameters.cmd_vel_timeout,
        exclusive=parameters.allow_multiple_cmd_vel_publishers is False,
        stamped=bool(parameters.use_stamped_vel),
        publish_cmd=bool(parameters.publish_cmd),
        warnings=(*_checked(model_path(name), left, right, turned.geometry, parameters), *idle),
    )


def scaled(drive: Drive, geometry: Geometry, live: Live) -> Drive:
    """The drive with the multipliers of ``live`` on the configured ``geometry``."""
    made = geometry.times(
        live.wheel_separation_multiplier, live.left_wheel_radius_multiplier, live.right_wheel_radius_multiplier
    )
    return Drive(
        made, drive.linear, drive.angular, drive.stop_linear, drive.stop_angular, drive.ramp, drive.keep_curvature
    )


def _live(model: Model, parameters: BaseParameters) -> Live:
    both = parameters.wheel_radius_multiplier
    rate, tf = parameters.publish_rate, parameters.enable_odom_tf
    return Live(
        wheel_separation_multiplier=parameters.wheel_separation_multiplier or 1.0,
        left_wheel_radius_multiplier=both or parameters.left_wheel_radius_multiplier or 1.0,
        right_wheel_radius_multiplier=both or parameters.right_wheel_radius_multiplier or 1.0,
        publish_rate=model.odometry_rate if rate is None else rate,
        enable_odom_tf=tf is not False,
    )


def _drive(wheels: Wheels, parameters: BaseParameters, geometry: Geometry) -> Drive:
    of_base = parameters.ramp == "base"
    around = geometry.separation / 2
    rise = wheels.acceleration if of_base else None
    fastest = (wheels.max_linear, wheels.max_angular) if parameters.clamp else (None, None)
    ros1 = parameters.jerk_rule == "ros1"
    linear = axis_of("linear", parameters.linear, fastest[0], rise, ros1)
    angular = axis_of("angular", parameters.angular, fastest[1], rise and rise / around, ros1)
    brake = parameters.brake or wheels.brake
    keep = bool(parameters.keep_curvature)
    if keep and (linear.jerks or angular.jerks):
        raise BadInput("keep_curvature slows one axis for the other, which a jerk limit does not allow: leave one out")
    if not of_base:
        if parameters.brake_angular is not None:
            raise BadInput('brake_angular needs ramp = "base": the wheels of this base brake each by itself, at brake')
        return Drive(geometry, linear, angular, FREE, FREE, Ramp(wheels.acceleration, brake, parameters.jump), keep)
    stop_angular = braking(angular, parameters.brake_angular or brake / around)
    return Drive(geometry, linear, angular, braking(linear, brake), stop_angular, NO_RAMP, keep)


def _checked(urdf: Path, left: str, right: str, used: Geometry, parameters: BaseParameters) -> list[str]:
    """Warnings about figures and wheels that do not fit the URDF; raises BadInput."""
    try:
        pair = read_wheels(urdf, left, right)
    except NoWheels as error:
        raise BadInput(f"{urdf}: {error}") from None
    if left == right:
        raise BadInput(f"left_wheel and right_wheel are both {left!r}: a base has one on each side")
    said = _swapped(pair, left, right, parameters.allow_swapped_wheels)
    if pair.left_radius is None or pair.right_radius is None:
        return [*said, f"{urdf}: no collision sphere or cylinder tells the wheels' radii: the figures are unchecked"]
    wrong = mismatch(used, Geometry(pair.separation, pair.left_radius, pair.right_radius))
    return [*said, wrong] if wrong else said


def _swapped(pair: WheelPair, left: str, right: str, allowed: bool) -> list[str]:
    if pair.left_offset >= pair.right_offset:
        return []
    text = (
        f"left_wheel {left!r} stands on the robot's right (y = {pair.left_offset:.3f} m), right_wheel {right!r} on its "
        f"left (y = {pair.right_offset:.3f} m): the base turns the wrong way, and its wheel odometry cannot see it"
    )
    if not allowed:
        raise BadInput(f"{text}. Exchange the two names, or set allow_swapped_wheels = true to drive so on purpose")
    return [text]


def _merged(ours: Any, given: Any) -> Any:
    """``given`` with the fields of ``ours`` where it has None; tables are merged field by field."""
    fields = {}
    for each in msgspec.structs.fields(given):
        mine, theirs = getattr(ours, each.name), getattr(given, each.name)
        if theirs is None:
            theirs = mine
        elif isinstance(theirs, msgspec.Struct) and mine is not None:
            theirs = _merged(mine, theirs)
        fields[each.name] = theirs
    return type(given)(**fields)
