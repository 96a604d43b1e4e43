"""What a robot's URDF cannot say: its drive and its sensors, from ``models/<name>/model.toml``."""

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
from models import UnknownModel, model_config_path, physics_urdf_path
from models.robot_cache import is_made
from models.robot_facts import read_facts
from models.urdf import NoWheels, read_robot, read_wheels

INFERRED_FILE = "model.json"
"""The model of a robot from outside without a ``model.toml``, in the folder that was made for it."""

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]


class ModelTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a model file; an unknown key is an error."""


class SteeredWheel(ModelTable, frozen=True, kw_only=True):
    """A wheel on a steering ``joint``: its place [m] ``ahead`` and ``left`` of the middle of the driven axle;
    ``reversed`` where the joint turns to the right."""

    joint: str
    ahead: float
    left: float = 0.0
    reversed: bool = False


class SteeringConfig(ModelTable, frozen=True, kw_only=True):
    """How a base is steered that drives as a car does: no tighter than ``max_curvature`` [1/m], by motors of ``torque``
    [N m] that turn its wheels at ``rate`` [rad/s]."""

    wheels: Annotated[tuple[SteeredWheel, ...], Meta(min_length=1, max_length=8)]
    max_curvature: Positive
    torque: Positive
    rate: Positive = 1.5


class WheelConfig(ModelTable, frozen=True, kw_only=True):
    """A base with driven wheels on its left and on its right: one on each side, or several that turn alike.

    Lengths in m; ``separation`` and ``radius`` are the URDF's unless stated. ``max_linear`` [m/s] and ``max_angular``
    [rad/s] are the hardware's; ``acceleration`` and ``brake`` [m/s2] are those of a wheel's rim, or of the base where
    ``drive`` says ``ramp = "base"``, the second after a time-out or an emergency stop; ``torque`` [N m] per wheel.
    ``reversed`` are joints whose positive speed drives backwards, as of motors that are mounted in mirror image. With
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
        """All driven wheels of the left."""
        return self.left_joint, *self.other_left

    @property
    def right_joints(self) -> tuple[str, ...]:
        """All driven wheels of the right."""
        return self.right_joint, *self.other_right


class PlanarConfig(ModelTable, frozen=True, kw_only=True):
    """A holonomic base, whose velocity is set as it is commanded: forwards, sideways and turning.

    ``max_linear`` [m/s] holds for either axis, ``max_angular`` in rad/s; ``acceleration`` and ``brake`` in m/s2,
    ``acceleration_angular`` in rad/s2.
    """

    max_linear: Positive
    max_angular: Positive
    acceleration: Positive
    acceleration_angular: Positive
    brake: Positive


class Mount(ModelTable, frozen=True, kw_only=True):
    """Where a sensor sits on its link, ``xyz`` [m] and ``rpy`` [rad], and the ``frame`` of its messages; the link's
    own where it is empty."""

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frame: str = ""

    @property
    def pose(self) -> Pose3:
        """In the link."""
        return Pose3(self.xyz, quaternion_from_rpy(*self.rpy))


ON_LINK = Mount()
"""At the link's origin, in its axes."""


class LaserConfig(ModelTable, frozen=True, kw_only=True):
    """A turning laser: ``samples`` rays, counter-clockwise in the link's plane, from ``angle_min`` [rad, from its x
    axis] to ``angle_max``, both included; without ``angle_max`` over a whole turn.

    ``rate`` [Hz], ranges and ``noise`` (standard deviation) in m. Rays start ``clearance`` [m] from the link's origin,
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
                f"angle_max - angle_min is {span:.4f} rad, it lies between 0 and 2 pi; leave out a whole turn"
            )
        if self.samples < 2:
            raise ValueError("from angle_min to angle_max there are at least 2 samples")

    @property
    def increment(self) -> float:
        """The angle from one ray to the next, rad."""
        if self.angle_max is None:
            return 2 * math.pi / self.samples
        return (self.angle_max - self.angle_min) / (self.samples - 1)


class SonarConfig(ModelTable, frozen=True, kw_only=True):
    """A ring of sonars, each at the origin of one of ``links`` and looking along its x axis.

    All hear ``rate`` times a second [Hz] the nearest echo within a cone of the whole angle ``cone`` [rad]; ranges and
    ``noise`` (standard deviation) in m. All are mounted on ``link``: their echoes are told as points in its frame.
    """

    link: str
    links: Annotated[tuple[str, ...], Meta(min_length=1, max_length=64)]
    rate: Positive
    cone: Annotated[float, Meta(gt=0, lt=3.14)]
    range_min: Positive
    range_max: Positive
    noise: NonNegative


class ImuConfig(ModelTable, frozen=True, kw_only=True):
    """An inertial unit: ``rate`` [Hz]; noises are standard deviations of one sample, rad/s and m/s2."""

    link: str
    rate: Positive
    gyro_noise: NonNegative
    acceleration_noise: NonNegative
    mount: Mount = ON_LINK


class CameraConfig(ModelTable, frozen=True, kw_only=True):
    """A pinhole camera: ``link`` is its optical frame (z forward, y down), or, without ``optical``, looks along its x
    axis; ``fov`` [rad] is horizontal, clips in m."""

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
    """How far the wheels of such a robot are from what its odometry takes them for: standard deviations, as shares.

    ``wheel_radius`` is that of the size of both wheels, ``wheel_radius_ratio`` that of the right one by the left one,
    ``wheel_separation`` that of the distance between the points at which they touch the ground.
    """

    wheel_radius: ErrorShare = 0.0
    wheel_radius_ratio: ErrorShare = 0.0
    wheel_separation: ErrorShare = 0.0


class RobotModel(ModelTable, frozen=True, kw_only=True):
    """A robot: ``radius`` [m] of the circle around ``base_frame`` that holds it, and what it carries.

    ``odometry_rate`` [Hz] is that of odometry and ground truth, ``joint_rate`` [Hz] that of the joint states, the same
    where it is not stated. ``fixed_base`` holds the root where it is. ``drive`` holds what this model's base driver
    takes for parameters that a fleet leaves open, by the names of ``services.sim.BaseParameters``. ``topics`` gives
    topics, by their names here, a second name in the robot's namespace.

    ``odometry`` is the pose in the world, or what the wheels' encoders tell, with ``odometry_error``; that counts from
    the robot's pose in the world, or from 0, by ``odometry_origin``. ``odom_frame`` is its frame.
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
        """Whether the wheels of such a robot are not quite what its odometry takes them for."""
        return self.odometry_error != OdometryErrorConfig()

    @property
    def has_base(self) -> bool:
        """Whether it drives by velocity commands; else it takes efforts on its joints."""
        return self.wheels is not None or self.planar is not None


def read_model(model: str) -> RobotModel:
    """The figures of a robot, by its name in this folder or by ``models.robot_source.RobotSource.model``; raises
    ``models.UnknownModel``, and BadInput for the file of a robot from outside."""
    path = model_config_path(model)
    return _read(model, path, path.stat().st_mtime_ns) if path.is_file() else _without_file(model)


@lru_cache(64)
def _read(model: str, path: Path, _: int) -> RobotModel:
    """Its file, read again when that has changed."""
    where = Path(read_facts(model).origin).with_name("model.toml") if is_made(model) else path
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        table = msgspec.toml.decode(text)
        if "wheels" in table:
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
    """What was inferred from the URDF when the robot's folder was made."""
    try:
        return msgspec.json.decode((Path(model) / INFERRED_FILE).read_bytes(), type=RobotModel)
    except (OSError, *DECODE_ERRORS):
        raise UnknownModel(f"the files of the robot {model} are gone or damaged: name it by its own file") from None


def _check_links(found: RobotModel, model: str, where: Path, text: str) -> None:
    """Raise BadInput for links that the URDF does not have."""
    links = [each.name for each in read_robot(model).links]
    named = {"base_frame": [found.base_frame]}
    for each in ("laser", "sonar", "imu", "camera"):
        if (part := getattr(found, each)) is not None:
            named[f"{each}.link"] = [part.link]
    if found.sonar is not None:
        named["sonar.links"] = list(found.sonar.links)
    for key, wanted in named.items():
        for link in wanted:
            if link not in links:
                raise unknown_name("link", link, links, f"{where}{_line(text, f'$.{key}')}: {key}")


def _line(text: str, error: str) -> str:
    """``:line`` of the key that a decoder's error names; empty where it names none."""
    if found := re.search(r"line (\d+)", error):
        return f":{found[1]}"
    if "end of document" in error:
        return f":{text.count(chr(10)) + 1}"
    field, path = re.search(r"field `(\w+)`", error), re.search(r"\$\.([\w.]+)", error)
    keys = [*(path[1].split(".") if path else ()), *([field[1]] if field else ())]
    line = 0
    lines = text.splitlines()
    for key in keys:
        pattern = re.compile(rf"\s*(\[\s*{key}\s*\]|{key}\s*=)")
        line = next((n for n, each in enumerate(lines) if n >= line and pattern.match(each)), line)
    return f":{line + 1}" if keys else ""


def _fill_from_urdf(wheels: dict[str, Any], name: str) -> None:
    """Fill in from the URDF what the model file leaves out of its wheels."""
    if {"separation", "radius"} <= wheels.keys() or not {"left_joint", "right_joint"} <= wheels.keys():
        return
    pair = read_wheels(physics_urdf_path(name), wheels["left_joint"], wheels["right_joint"])
    if pair.left_radius is None and "radius" not in wheels:
        raise NoWheels(f"{name}: neither [wheels] nor a collision sphere or cylinder of the left wheel tells a radius")
    wheels.setdefault("separation", pair.separation)
    wheels.setdefault("radius", pair.left_radius)
