"""sensor_msgs: joints, lasers, sonars, inertial data and cameras."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Finite, Float32Array, Matrix3, Message, Metres, Radians, ensure_array
from messages.geometry import Point32, Quaternion, Vector3
from messages.std import Header

Seconds = Annotated[float, Meta(ge=0, le=1e6, extra={"unit": "s"})]


class JointState(Message, frozen=True, kw_only=True):
    """Position [rad or m], velocity [rad/s or m/s] and effort [N m or N] of the named joints; each list may be empty.

    An unmeasured effort is NaN, as ROS drivers publish it.
    """

    ROS_TYPE: ClassVar[str] = "sensor_msgs/JointState"
    header: Header = Header()
    name: tuple[str, ...] = ()
    position: tuple[Finite, ...] = ()
    velocity: tuple[Finite, ...] = ()
    effort: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for part in ("position", "velocity", "effort"):
            if (count := len(getattr(self, part))) not in (0, len(self.name)):
                raise ValueError(f"{part} has {count} values for {len(self.name)} joint names")


class LaserScan(Message, frozen=True, kw_only=True):
    """One scan of a laser; ``ranges`` [m], shape (n,), counter-clockwise from ``angle_min``; inf means no echo."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/LaserScan"
    header: Header = Header()
    angle_min: Radians = 0.0
    angle_max: Radians = 0.0
    angle_increment: Radians = 0.0
    time_increment: Seconds = 0.0
    scan_time: Seconds = 0.0
    range_min: Metres = 0.0
    range_max: Metres = 0.0
    ranges: Float32Array = Float32Array()
    intensities: Float32Array = Float32Array()

    def __post_init__(self) -> None:
        ranges = ensure_array(self, "ranges", Float32Array).shape
        intensities = ensure_array(self, "intensities", Float32Array).shape
        if len(ranges) != 1 or intensities not in ((0,), ranges):
            raise ValueError(
                f"ranges and intensities must be flat and of equal length, got the shapes {ranges} and {intensities}"
            )


class Range(Message, frozen=True, kw_only=True):
    """One reading of a sonar or infrared ranger along the x axis of the header's frame.

    ``field_of_view`` [rad] is the full angle of the cone, ``range`` [m] the nearest echo: inf without one, -inf if it
    is nearer than ``min_range``, NaN for an invalid reading (REP 117).
    """

    ROS_TYPE: ClassVar[str] = "sensor_msgs/Range"
    ULTRASOUND: ClassVar[int] = 0
    INFRARED: ClassVar[int] = 1
    header: Header = Header()
    radiation_type: Annotated[int, Meta(ge=0, le=1)] = ULTRASOUND
    field_of_view: Radians = 0.0
    min_range: Metres = 0.0
    max_range: Metres = 0.0
    range: float = 0.0


class ChannelFloat32(Message, frozen=True, kw_only=True):
    """One value for each point of a cloud; ``name`` says what it is."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/ChannelFloat32"
    name: str = ""
    values: Float32Array = Float32Array()

    def __post_init__(self) -> None:
        ensure_array(self, "values", Float32Array)


class PointCloud(Message, frozen=True, kw_only=True):
    """Points [m] in the header's frame, with additional channels of values per point."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/PointCloud"
    header: Header = Header()
    points: tuple[Point32, ...] = ()
    channels: tuple[ChannelFloat32, ...] = ()

    def __post_init__(self) -> None:
        for channel in self.channels:
            if channel.values.shape != (len(self.points),):
                raise ValueError(
                    f"channel {channel.name[:80]!r} has the shape {channel.values.shape}, {len(self.points)} points"
                    " need one value each"
                )


class Imu(Message, frozen=True, kw_only=True):
    """Orientation, angular velocity [rad/s] and specific force [m/s2] in the header's frame."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/Imu"
    header: Header = Header()
    orientation: Quaternion = Quaternion()
    orientation_covariance: Matrix3 = (0.0,) * 9
    angular_velocity: Vector3 = Vector3()
    angular_velocity_covariance: Matrix3 = (0.0,) * 9
    linear_acceleration: Vector3 = Vector3()
    linear_acceleration_covariance: Matrix3 = (0.0,) * 9


class Image(Message, frozen=True, kw_only=True):
    """An uncompressed image, ``height`` rows of ``step`` bytes."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/Image"
    header: Header = Header()
    height: Annotated[int, Meta(ge=0, le=16384)] = 0
    width: Annotated[int, Meta(ge=0, le=16384)] = 0
    encoding: str = "rgb8"
    is_bigendian: Annotated[int, Meta(ge=0, le=1)] = 0
    step: Annotated[int, Meta(ge=0, le=2**20)] = 0
    data: bytes = b""

    def __post_init__(self) -> None:
        if len(self.data) != self.height * self.step:
            expected = self.height * self.step
            raise ValueError(
                f"data has {len(self.data)} bytes, but {self.height} rows of {self.step} bytes need {expected}"
            )


class CameraInfo(Message, frozen=True, kw_only=True):
    """Calibration of a camera: distortion ``d``, intrinsics ``k`` and rotation ``r`` (3x3), projection ``p`` (3x4)."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/CameraInfo"
    header: Header = Header()
    height: Annotated[int, Meta(ge=0, le=16384)] = 0
    width: Annotated[int, Meta(ge=0, le=16384)] = 0
    distortion_model: str = "plumb_bob"
    d: tuple[float, ...] = ()
    k: Matrix3 = (0.0,) * 9
    r: Matrix3 = (0.0,) * 9
    p: Annotated[tuple[float, ...], Meta(min_length=12, max_length=12)] = (0.0,) * 12
