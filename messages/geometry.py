"""geometry_msgs: points, poses, twists and transforms in 3D."""

import math
from typing import ClassVar, Self

from msgspec import field

from messages.base import Finite, Message, Metres, Packed36, check36, covariance, unpack36
from messages.std import Header

FASTEST_LINEAR = 100.0
"""Maximum linear speed [m/s] of a command or measurement of a ground robot; bases refuse commands beyond it."""
FASTEST_ANGULAR = 1000.0
"""Maximum angular speed [rad/s], as FASTEST_LINEAR."""


class Vector3(Message, frozen=True, kw_only=True):
    """Three finite numbers; their unit depends on the field."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Vector3"
    x: Finite = 0.0
    y: Finite = 0.0
    z: Finite = 0.0


class Point(Message, frozen=True, kw_only=True):
    """A position, m."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Point"
    x: Metres = 0.0
    y: Metres = 0.0
    z: Metres = 0.0


class Point32(Message, frozen=True, kw_only=True):
    """A position in a point cloud, m."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Point32"
    x: Metres = 0.0
    y: Metres = 0.0
    z: Metres = 0.0


class Quaternion(Message, frozen=True, kw_only=True):
    """An orientation; unit length, identity by default."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Quaternion"
    x: Finite = 0.0
    y: Finite = 0.0
    z: Finite = 0.0
    w: Finite = 1.0

    @classmethod
    def from_yaw(cls, yaw: float) -> Self:
        """Return the rotation by ``yaw`` [rad] about the z axis."""
        return cls(z=math.sin(yaw / 2), w=math.cos(yaw / 2))

    @property
    def yaw(self) -> float:
        """Heading about the z axis, rad in (-pi, pi]."""
        return math.atan2(2 * (self.w * self.z + self.x * self.y), 1 - 2 * (self.y * self.y + self.z * self.z))


class Pose(Message, frozen=True, kw_only=True):
    """Position and orientation."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Pose"
    position: Point = Point()
    orientation: Quaternion = Quaternion()

    @classmethod
    def planar(cls, x: float, y: float, yaw: float = 0.0) -> Self:
        """Return the pose (x [m], y [m], yaw [rad]) on the ground."""
        return cls(position=Point(x=x, y=y), orientation=Quaternion.from_yaw(yaw))


class PoseStamped(Message, frozen=True, kw_only=True):
    """A pose in the frame and at the time of its header."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/PoseStamped"
    header: Header = Header()
    pose: Pose = Pose()


class PoseArray(Message, frozen=True, kw_only=True):
    """Several poses in the frame and at the time of the header."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/PoseArray"
    header: Header = Header()
    poses: tuple[Pose, ...] = ()


class PointStamped(Message, frozen=True, kw_only=True):
    """A position in the frame and at the time of its header."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/PointStamped"
    header: Header = Header()
    point: Point = Point()


class PoseWithCovariance(Message, frozen=True, kw_only=True):
    """A pose and its 6x6 covariance; set ``packed``, e.g. to the result of ``messages.base.covariance``."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/PoseWithCovariance"
    pose: Pose = Pose()
    packed: Packed36 = field(default=covariance(0, 0, 0, 0, 0, 0), name="covariance")

    def __post_init__(self) -> None:
        check36(self.packed)

    @property
    def covariance(self) -> tuple[float, ...]:
        """The 36 values; raises WrongPayload if the publisher packed something else."""
        return unpack36(self.packed)


class Wrench(Message, frozen=True, kw_only=True):
    """Force [N] and torque [N m]."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Wrench"
    force: Vector3 = Vector3()
    torque: Vector3 = Vector3()


class Twist(Message, frozen=True, kw_only=True):
    """Velocity: linear in m/s, angular in rad/s; a base refuses values beyond FASTEST_LINEAR or FASTEST_ANGULAR."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Twist"
    linear: Vector3 = Vector3()
    angular: Vector3 = Vector3()

    @classmethod
    def planar(cls, v: float, w: float) -> Self:
        """Return the twist of a ground robot: forward speed ``v`` [m/s], turn rate ``w`` [rad/s]."""
        return cls(linear=Vector3(x=v), angular=Vector3(z=w))


class TwistStamped(Message, frozen=True, kw_only=True):
    """A twist at the time of its header."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/TwistStamped"
    header: Header = Header()
    twist: Twist = Twist()


class TwistWithCovariance(Message, frozen=True, kw_only=True):
    """A twist and its 6x6 covariance, set as in PoseWithCovariance."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/TwistWithCovariance"
    twist: Twist = Twist()
    packed: Packed36 = field(default=covariance(0, 0, 0, 0, 0, 0), name="covariance")

    def __post_init__(self) -> None:
        check36(self.packed)

    @property
    def covariance(self) -> tuple[float, ...]:
        """The 36 values; raises WrongPayload if the publisher packed something else."""
        return unpack36(self.packed)


class Transform(Message, frozen=True, kw_only=True):
    """Translation [m] and rotation from a parent to a child frame."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/Transform"
    translation: Vector3 = Vector3()
    rotation: Quaternion = Quaternion()


class TransformStamped(Message, frozen=True, kw_only=True):
    """The pose of ``child_frame_id`` in the header's frame."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/TransformStamped"
    header: Header = Header()
    child_frame_id: str = ""
    transform: Transform = Transform()


STOP = Twist()
"""The command that stops a robot."""
