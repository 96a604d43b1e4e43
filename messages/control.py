"""control_msgs: states of joint controllers, and the action that follows a trajectory."""

from enum import IntEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from messages.actionlib import GoalID, GoalStatus
from messages.base import Finite, Message, NameStr
from messages.std import Duration, Header
from messages.trajectory import JointTrajectory, JointTrajectoryPoint


class JointControllerState(Message, frozen=True, kw_only=True):
    """One tick of a controller; ``header.stamp`` is the time of the tick.

    ``command`` is the effort [N m]; ``p``, ``i`` and ``d`` are the gains in force, ``i_clamp`` bounds the integral's
    share of the effort. ROS leaves the unit of the rest to the controller: services/arm has degrees, degrees per second
    and N m per degree. ``time_step`` [s] is the time since the last tick, ``set_point`` what was wanted at this one.
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
    """How far a joint may be off: 0 leaves the controller's own tolerance, a negative value is none."""

    ROS_TYPE: ClassVar[str] = "control_msgs/JointTolerance"
    name: NameStr = ""
    position: Finite = 0.0
    velocity: Finite = 0.0
    acceleration: Finite = 0.0


class FollowJointTrajectoryGoal(Message, frozen=True, kw_only=True):
    """A trajectory, how far joints may leave it, how near they must end, and how late."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryGoal"
    trajectory: JointTrajectory = JointTrajectory()
    path_tolerance: tuple[JointTolerance, ...] = ()
    goal_tolerance: tuple[JointTolerance, ...] = ()
    goal_time_tolerance: Duration = Duration()


class TrajectoryError(IntEnum):
    """The numbers of ``FollowJointTrajectoryResult.error_code``."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class FollowJointTrajectoryResult(Message, frozen=True, kw_only=True):
    """How a trajectory ended: a number of ``TrajectoryError``, and why."""

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
    """A goal with its name; a server gives one to a goal that has none."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryActionGoal"
    header: Header = Header()
    goal_id: GoalID = GoalID()
    goal: FollowJointTrajectoryGoal = FollowJointTrajectoryGoal()


class FollowJointTrajectoryActionResult(Message, frozen=True, kw_only=True):
    """How a goal ended, once for each."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryActionResult"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    result: FollowJointTrajectoryResult = FollowJointTrajectoryResult()


class FollowJointTrajectoryActionFeedback(Message, frozen=True, kw_only=True):
    """How far the goal that is followed is."""

    ROS_TYPE: ClassVar[str] = "control_msgs/FollowJointTrajectoryActionFeedback"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    feedback: FollowJointTrajectoryFeedback = FollowJointTrajectoryFeedback()
