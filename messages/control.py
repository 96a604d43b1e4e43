"""control_msgs: states of joint controllers, and the FollowJointTrajectory action."""

from enum import IntEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from messages.actionlib import GoalID, GoalStatus
from messages.base import Finite, Message, NameStr
from messages.std import Duration, Header
from messages.trajectory import JointTrajectory, JointTrajectoryPoint


class JointControllerState(Message, frozen=True, kw_only=True):
    """One tick of a controller; ``header.stamp`` is the time of the tick.

    ``command`` is the effort [N m]; ``p``, ``i`` and ``d`` are the current gains, ``i_clamp`` bounds the integral term.
    ROS leaves the unit of the rest to the controller: services/arm uses degrees, degrees per second and N m per degree.
    ``time_step`` [s] is the time since the last tick, ``set_point`` the set-point at this one.
    """

    ROS_TYPE: ClassVar[str] = "control_msgs/JointControllerState"
    header: Header = Header()
    set_point: Finite = 0.0
    process_value: Finite = 0.0
    process_value_dot: Finite = 0.0
    error: Finite = 0.0
    time_step: Finite = 0.0
    command: Finite = 0.0
    p: Finite = 0.0
    i: Finite = 0.0
    d: Finite = 0.0
    i_clamp: Finite = 0.0
    antiwindup: bool = False


class JointTrajectoryControllerState(Message, frozen=True, kw_only=True):
    """Desired and actual state of a trajectory controller's joints, and the error (desired minus actual)."""

    ROS_TYPE: ClassVar[str] = "control_msgs/JointTrajectoryControllerState"
    header: Header = Header()
    joint_names: tuple[NameStr, ...] = ()
    desired: JointTrajectoryPoint = JointTrajectoryPoint()
    actual: JointTrajectoryPoint = JointTrajectoryPoint()
    error: JointTrajectoryPoint = JointTrajectoryPoint()


class JointTolerance(Message, frozen=True, kw_only=True):
    """Tolerance of a joint: 0 keeps the controller's own tolerance, a negative value means no limit."""

    ROS_TYPE: ClassVar[str] = "control_msgs/JointTolerance"
    name: NameStr = ""
    position: Finite = 0.0
    velocity: Finite = 0.0
    acceleration: Finite = 0.0


class FollowJointTrajectoryGoal(Message, frozen=True, kw_only=True):
    """A trajectory with the tolerances of its path and goal, and the time allowed beyond its end."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryGoal"
    trajectory: JointTrajectory = JointTrajectory()
    path_tolerance: tuple[JointTolerance, ...] = ()
    goal_tolerance: tuple[JointTolerance, ...] = ()
    goal_time_tolerance: Duration = Duration()


class TrajectoryError(IntEnum):
    """The values of ``FollowJointTrajectoryResult.error_code``."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class FollowJointTrajectoryResult(Message, frozen=True, kw_only=True):
    """Outcome of a trajectory: a value of ``TrajectoryError`` and an explanation."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryResult"
    error_code: Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)] = 0
    error_string: str = ""


class FollowJointTrajectoryFeedback(Message, frozen=True, kw_only=True):
    """Desired and actual state of a goal's joints, and the error (desired minus actual)."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryFeedback"
    header: Header = Header()
    joint_names: tuple[NameStr, ...] = ()
    desired: JointTrajectoryPoint = JointTrajectoryPoint()
    actual: JointTrajectoryPoint = JointTrajectoryPoint()
    error: JointTrajectoryPoint = JointTrajectoryPoint()


class FollowJointTrajectoryActionGoal(Message, frozen=True, kw_only=True):
    """A goal with its ID; the server assigns one to a goal that has none."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryActionGoal"
    header: Header = Header()
    goal_id: GoalID = GoalID()
    goal: FollowJointTrajectoryGoal = FollowJointTrajectoryGoal()


class FollowJointTrajectoryActionResult(Message, frozen=True, kw_only=True):
    """Outcome of a goal, published once per goal."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryActionResult"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    result: FollowJointTrajectoryResult = FollowJointTrajectoryResult()


class FollowJointTrajectoryActionFeedback(Message, frozen=True, kw_only=True):
    """Progress of the active goal."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryActionFeedback"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    feedback: FollowJointTrajectoryFeedback = FollowJointTrajectoryFeedback()
