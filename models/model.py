"""What a robot's URDF cannot state: its drive and its sensors, from ``models/<name>/model.toml``."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from messages.base import DECODE_ERRORS
from messages.errors import BadInput, unknown_name
from messages.se3 import Pose3, quaternion_from_rpy
from models import model_config_path, not_in_cache, physics_urdf_path
from models.robot_cache import is_imported
from models.robot_facts import read_facts
from models.urdf import NoWheels, read_robot, read_wheels

INFERRED_FILE = "model.json"
"""Inferred model of an imported robot without a ``model.toml``, in the robot's cache folder."""

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]


class ModelTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a model file; an unknown key is an error."""


class SteeredWheel(ModelTable, frozen=True, kw_only=True):
    """A wheel on a steering ``joint``: its position [m] ``ahead`` and ``left`` of the centre of the driven axle;
    ``reversed`` if positive joint angles steer to the right."""

    joint: str
    ahead: float
    left: float = 0.0
    reversed: bool = False


class SteeringConfig(ModelTable, frozen=True, kw_only=True):
    """Steering of a car-like base: at most ``max_curvature`` [1/m], with motors of ``torque`` [N m] that turn the
    wheels at ``rate`` [rad/s]."""

    wheels: Annotated[tuple[SteeredWheel, ...], Meta(min_length=1, max_length=8)]
    max_curvature: Positive
    torque: Positive
    rate: Positive = 1.5


class WheelConfig(ModelTable, frozen=True, kw_only=True):
    """A base with driven wheels on its left and right: one on each side, or several that turn at the same speed.

    Lengths in m; ``separation`` and ``radius`` default to the URDF's. ``max_linear`` [m/s] and ``max_angular`` [rad/s]
    are the hardware's limits; ``acceleration`` and ``brake`` [m/s2] are those of a wheel's rim, or of the base if
    ``drive`` has ``ramp = "base"``; ``brake`` applies after a time-out or an emergency stop; ``torque`` [N m] is per
    wheel. ``reversed`` lists joints whose positive speed drives backwards, as with motors mounted in mirror image. With
    ``steering``, these wheels are those of the one axle that is not steered.
    """

    left_joint: str
    right_joint: str
    separation: Positive
    radius: Positive
    max_linear: Positive
    max_angular: Positive
    acceleration: Positive
    brake: Positive
    torque: Positive
    other_left: tuple[str, ...] = ()
    other_right: tuple[str, ...] = ()
    reversed: tuple[str, ...] = ()
    steering: SteeringConfig | None = None

    @property
    def left_joints(self) -> tuple[str, ...]:
        """All driven joints on the left."""
        return self.left_joint, *self.other_left

    @property
    def right_joints(self) -> tuple[str, ...]:
        """All driven joints on the right."""
        return self.right_joint, *self.other_right


class PlanarConfig(ModelTable, frozen=True, kw_only=True):
    """A holonomic base, whose velocity is set as commanded: forwards, sideways and turning.

    ``max_linear`` [m/s] applies to each axis, ``max_angular`` is in rad/s; ``acceleration`` and ``brake`` are in m/s2,
    ``acceleration_angular`` in rad/s2.
    """

    max_linear: Positive
    max_angular: Positive
    acceleration: Positive
    acceleration_angular: Positive
    brake: Positive


class Mount(ModelTable, frozen=True, kw_only=True):
    """Pose of a sensor on its link, ``xyz`` [m] and ``rpy`` [rad], and the ``frame`` of its messages; the link's own if
    empty."""

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frame: str = ""

    @property
    def pose(self) -> Pose3:
        """The pose in the link's frame."""
        return Pose3(self.xyz, quaternion_from_rpy(*self.rpy))


ON_LINK = Mount()
"""The mount at the link's origin, along its axes."""


class LaserConfig(ModelTable, frozen=True, kw_only=True):
    """A rotating laser: ``samples`` rays, counter-clockwise in the link's plane, from ``angle_min`` [rad, from the x
    axis] to ``angle_max``, inclusive; without ``angle_max``, over a full turn.

    ``rate`` in Hz, ranges and ``noise`` (standard deviation) in m. Rays start ``clearance`` [m] from the link's origin,
    outside the laser's own housing.
    """

    link: str
    rate: Positive
    samples: Annotated[int, Meta(ge=1, le=10_000)]
    range_min: Positive
    range_max: Positive
    noise: NonNegative
    clearance: Positive
    angle_min: float = 0.0
    angle_max: float | None = None
    mount: Mount = ON_LINK

    def __post_init__(self) -> None:
        if self.angle_max is None:
            return
        span = self.angle_max - self.angle_min
        if not 0 < span < 2 * math.pi:
            raise ValueError(
                f"angle_max - angle_min is {span:.4f} rad, not between 0 and 2 pi; for a full turn, leave out angle_max"
            )
        if self.samples < 2:
            raise ValueError("a laser with angle_max needs at least 2 samples")

    @property
    def increment(self) -> float:
        """The angle between adjacent rays, rad."""
        if self.angle_max is None:
            return 2 * math.pi / self.samples
        return (self.angle_max - self.angle_min) / (self.samples - 1)


class SonarConfig(ModelTable, frozen=True, kw_only=True):
    """A ring of sonars, each at the origin of one of ``links`` and facing along its x axis.

    At ``rate`` [Hz], each measures the nearest echo within a cone of full angle ``cone`` [rad]; ranges and ``noise``
    (standard deviation) in m. All are mounted on ``link``: their echoes are published as points in its frame.
    """

    link: str
    links: Annotated[tuple[str, ...], Meta(min_length=1, max_length=64)]
    rate: Positive
    cone: Annotated[float, Meta(gt=0, lt=3.14)]
    range_min: Positive
    range_max: Positive
    noise: NonNegative


class ImuConfig(ModelTable, frozen=True, kw_only=True):
    """An IMU: ``rate`` in Hz; noises are standard deviations per sample, rad/s and m/s2."""

    link: str
    rate: Positive
    gyro_noise: NonNegative
    acceleration_noise: NonNegative
    mount: Mount = ON_LINK


class CameraConfig(ModelTable, frozen=True, kw_only=True):
    """A pinhole camera: ``link`` is its optical frame (z forward, y down), or, if not ``optical``, it faces along the
    link's x axis; ``fov`` [rad] is horizontal, clips in m."""

    link: str
    rate: Positive
    width: Annotated[int, Meta(ge=1, le=4096)]
    height: Annotated[int, Meta(ge=1, le=4096)]
    fov: Annotated[float, Meta(gt=0, lt=3.14)]
    near: Positive
    far: Positive
    optical: bool = True
    mount: Mount = ON_LINK


ErrorShare = Annotated[float, Meta(ge=0, le=0.05)]


class OdometryErrorConfig(ModelTable, frozen=True, kw_only=True):
    """Deviation of the robots' wheels from the values that odometry assumes: relative standard deviations.

    ``wheel_radius`` is that of both wheels' radius, ``wheel_radius_ratio`` that of the right radius over the left one,
    ``wheel_separation`` that of the distance between their contact points with the ground.
    """

    wheel_radius: ErrorShare = 0.0
    wheel_radius_ratio: ErrorShare = 0.0
    wheel_separation: ErrorShare = 0.0


class RobotModel(ModelTable, frozen=True, kw_only=True):
    """A robot: ``radius`` [m] of the circle around ``base_frame`` that encloses it, its drive and its sensors.

    ``odometry_rate`` [Hz] is that of odometry and ground truth, ``joint_rate`` [Hz] that of the joint states, by
    default the same. ``fixed_base`` fixes the root to the world. ``drive`` has this model's defaults of base parameters
    that a fleet does not set, named as in ``services.sim.BaseParameters``. ``topics`` gives topics, by their names
    here, a second name in the robot's namespace.

    ``odometry`` is from the pose in the world, or from the wheel encoders, with ``odometry_error``; the latter starts
    at the robot's pose in the world, or at 0, depending on ``odometry_origin``. ``odom_frame`` is its frame.
    """

    about: str
    base_frame: str
    radius: Positive
    odometry: Literal["world", "encoder"]
    odometry_origin: Literal["world", "start"] = "start"
    odometry_error: OdometryErrorConfig = OdometryErrorConfig()
    odometry_rate: Positive
    joint_rate: Positive | None = None
    fixed_base: bool = False
    wheels: WheelConfig | None = None
    planar: PlanarConfig | None = None
    odom_frame: str = "odom"
    topics: dict[str, str] = {}
    drive: dict[str, Any] = {}
    laser: LaserConfig | None = None
    sonar: SonarConfig | None = None
    imu: ImuConfig | None = None
    camera: CameraConfig | None = None

    @property
    def drifts(self) -> bool:
        """Whether the robots' wheels deviate from the values that odometry assumes."""
        return self.odometry_error != OdometryErrorConfig()

    @property
    def has_base(self) -> bool:
        """Whether it drives by velocity commands; otherwise its joints are commanded by effort."""
        return self.wheels is not None or self.planar is not None


def read_model(model: str) -> RobotModel:
    """Read the model of a robot, by its name in this folder or by ``models.robot_source.RobotSource.model``; raises
    ``models.UnknownModel``, and BadInput for an invalid file of an imported robot."""
    path = model_config_path(model)
    return _read(model, path, path.stat().st_mtime_ns) if path.is_file() else _without_file(model)


@lru_cache(64)
def _read(model: str, path: Path, _: int) -> RobotModel:
    """Read its file; cached until the file changes."""
    where = Path(read_facts(model).origin).with_name("model.toml") if is_imported(model) else path
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        table = msgspec.toml.decode(text)
        if isinstance(table.get("wheels"), dict):
            _fill_from_urdf(table["wheels"], model)
        found = msgspec.convert(table, RobotModel)
    except NoWheels as error:
        raise NoWheels(f"{where}: {error}") from None
    except msgspec.MsgspecError as error:
        raise BadInput(f"{where}{_line(text, str(error))}: {error}") from None
    _check_links(found, model, where, text)
    return found


@lru_cache(64)
def _without_file(model: str) -> RobotModel:
    """Read the model that was inferred from the URDF when the robot's folder was created."""
    try:
        return msgspec.json.decode((Path(model) / INFERRED_FILE).read_bytes(), type=RobotModel)
    except (OSError, *DECODE_ERRORS):
        raise not_in_cache(model) from None


def _check_links(found: RobotModel, model: str, where: Path, text: str) -> None:
    """Raise BadInput for links that the URDF does not have."""
    links = [each.name for each in read_robot(model).links]
    named = {"base_frame": [found.base_frame]}
    for each in ("laser", "sonar", "imu", "camera"):
        if (part := getattr(found, each)) is not None:
            named[f"{each}.link"] = [part.link]
    if found.sonar is not None:
        named["sonar.links"] = list(found.sonar.links)
    for key, names in named.items():
        for link in names:
            if link not in links:
                raise unknown_name("link", link, links, f"{where}{_line(text, f'$.{key}')}: {key}")


def _line(text: str, error: str) -> str:
    """Return ``:line`` of the key in a decoding error; empty if it names none."""
    if found := re.search(r"line (\d+)", error):
        return f":{found[1]}"
    if "end of document" in error:
        return f":{text.count(chr(10)) + 1}"
    field, path = re.search(r"field `(\w+)`", error), re.search(r"\$\.([\w.]+)", error)
    keys = [*(path[1].split(".") if path else ()), *([field[1]] if field else ())]
    line = 0
    lines = text.splitlines()
    for key in keys:
        pattern = re.compile(rf"\s*(\[+\s*{key}\s*\]|{key}\s*=)")
        line = next((n for n, each in enumerate(lines) if n >= line and pattern.match(each)), line)
    return f":{line + 1}" if keys else ""


def _fill_from_urdf(wheels: dict[str, Any], name: str) -> None:
    """Fill in missing wheel values of the model file from the URDF."""
    left, right = wheels.get("left_joint"), wheels.get("right_joint")
    if {"separation", "radius"} <= wheels.keys() or not (isinstance(left, str) and isinstance(right, str)):
        return
    pair = read_wheels(physics_urdf_path(name), left, right)
    if pair.left_radius is None and "radius" not in wheels:
        raise NoWheels(f"{name}: neither [wheels] nor a collision sphere or cylinder of the left wheel gives a radius")
    wheels.setdefault("separation", pair.separation)
    wheels.setdefault("radius", pair.left_radius)
