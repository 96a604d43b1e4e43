"""trajectory_msgs: joint positions over time."""

from typing import ClassVar

from messages.base import Finite, Message, NameStr
from messages.std import Duration, Header


class JointTrajectoryPoint(Message, frozen=True, kw_only=True):
    """Positions [rad or m], velocities [rad/s or m/s], accelerations [rad/s2 or m/s2] and effort [N m or N] of joints,
    in the order of the trajectory's ``joint_names``; unspecified lists are empty. ``time_from_start`` counts from the
    trajectory's stamp."""

    ROS_TYPE: ClassVar[str] = "trajectory_msgs/JointTrajectoryPoint"
    positions: tuple[Finite, ...] = ()
    velocities: tuple[Finite, ...] = ()
    accelerations: tuple[Finite, ...] = ()
    effort: tuple[Finite, ...] = ()
    time_from_start: Duration = Duration()


class JointTrajectory(Message, frozen=True, kw_only=True):
    """Points for joints to pass through. ``header.stamp`` is the start time; 0 means at once."""

    ROS_TYPE: ClassVar[str] = "trajectory_msgs/JointTrajectory"
    header: Header = Header()
    joint_names: tuple[NameStr, ...] = ()
    points: tuple[JointTrajectoryPoint, ...] = ()
