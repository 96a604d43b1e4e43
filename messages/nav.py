"""nav_msgs: odometry and paths."""

from typing import ClassVar

from messages.base import Message
from messages.geometry import PoseStamped, PoseWithCovariance, TwistWithCovariance
from messages.std import Header


class Odometry(Message, frozen=True, kw_only=True):
    """Pose of ``child_frame_id`` in the header's frame, twist in ``child_frame_id``."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/Odometry"
    header: Header = Header()
    child_frame_id: str = ""
    pose: PoseWithCovariance = PoseWithCovariance()
    twist: TwistWithCovariance = TwistWithCovariance()


class Path(Message, frozen=True, kw_only=True):
    """Poses to drive through, in order."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/Path"
    header: Header = Header()
    poses: tuple[PoseStamped, ...] = ()
