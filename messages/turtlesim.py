"""turtlesim: the pose of a turtle, the colour below it, and the services of its simulation."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.actionlib import GoalID, GoalStatus
from messages.base import Finite, Message, NameStr
from messages.std import Header

Byte = Annotated[int, Meta(ge=0, le=255)]


class Pose(Message, frozen=True, kw_only=True):
    """Position [m] of a turtle on its plane, from the lower left corner, and its velocity [m/s, rad/s].

    ``theta`` is in [-pi, pi], counter-clockwise from the x axis.
    """

    ROS_TYPE: ClassVar[str] = "turtlesim/Pose"
    x: Annotated[Finite, Meta(extra={"unit": "m"})] = 0.0
    y: Annotated[Finite, Meta(extra={"unit": "m"})] = 0.0
    theta: Annotated[Finite, Meta(extra={"unit": "rad"})] = 0.0
    linear_velocity: Annotated[Finite, Meta(extra={"unit": "m/s"})] = 0.0
    angular_velocity: Annotated[Finite, Meta(extra={"unit": "rad/s"})] = 0.0


class Color(Message, frozen=True, kw_only=True):
    """The colour of the plane below a turtle."""

    ROS_TYPE: ClassVar[str] = "turtlesim/Color"
    r: Byte = 0
    g: Byte = 0
    b: Byte = 0


class Spawn(Message, frozen=True, kw_only=True):
    """Add a turtle at a pose [m, m, rad]; without a name, it gets the next free one."""

    ROS_TYPE: ClassVar[str] = "turtlesim/Spawn"
    x: Finite = 0.0
    y: Finite = 0.0
    theta: Finite = 0.0
    name: NameStr = ""


class SpawnResponse(Message, frozen=True, kw_only=True):
    """The name of the new turtle."""

    ROS_TYPE: ClassVar[str] = "turtlesim/SpawnResponse"
    name: str = ""


class Kill(Message, frozen=True, kw_only=True):
    """Remove a turtle."""

    ROS_TYPE: ClassVar[str] = "turtlesim/Kill"
    name: NameStr = ""


class KillResponse(Message, frozen=True, kw_only=True):
    """The turtle was removed."""

    ROS_TYPE: ClassVar[str] = "turtlesim/KillResponse"


class SetPen(Message, frozen=True, kw_only=True):
    """Set colour and width [pixels] of a turtle's pen; 0 keeps the width. A nonzero ``off`` lifts the pen."""

    ROS_TYPE: ClassVar[str] = "turtlesim/SetPen"
    r: Byte = 0
    g: Byte = 0
    b: Byte = 0
    width: Byte = 0
    off: Byte = 0


class SetPenResponse(Message, frozen=True, kw_only=True):
    """The pen was set."""

    ROS_TYPE: ClassVar[str] = "turtlesim/SetPenResponse"


class TeleportAbsolute(Message, frozen=True, kw_only=True):
    """Move a turtle to a pose [m, m, rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportAbsolute"
    x: Finite = 0.0
    y: Finite = 0.0
    theta: Finite = 0.0


class TeleportAbsoluteResponse(Message, frozen=True, kw_only=True):
    """The turtle was moved."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportAbsoluteResponse"


class TeleportRelative(Message, frozen=True, kw_only=True):
    """Turn a turtle [rad], then move it ahead [m]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportRelative"
    linear: Finite = 0.0
    angular: Finite = 0.0


class TeleportRelativeResponse(Message, frozen=True, kw_only=True):
    """The turtle was moved."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportRelativeResponse"


class RotateAbsoluteGoal(Message, frozen=True, kw_only=True):
    """The target heading [rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteGoal"
    theta: Finite = 0.0


class RotateAbsoluteResult(Message, frozen=True, kw_only=True):
    """The angle from the turtle's final heading to its initial one [rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteResult"
    delta: Finite = 0.0


class RotateAbsoluteFeedback(Message, frozen=True, kw_only=True):
    """The remaining angle [rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteFeedback"
    remaining: Finite = 0.0


class RotateAbsoluteActionGoal(Message, frozen=True, kw_only=True):
    """A goal, as published on the action's topic."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteActionGoal"
    header: Header = Header()
    goal_id: GoalID = GoalID()
    goal: RotateAbsoluteGoal = RotateAbsoluteGoal()


class RotateAbsoluteActionResult(Message, frozen=True, kw_only=True):
    """The outcome of a goal."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteActionResult"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    result: RotateAbsoluteResult = RotateAbsoluteResult()


class RotateAbsoluteActionFeedback(Message, frozen=True, kw_only=True):
    """Progress of the active goal."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteActionFeedback"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    feedback: RotateAbsoluteFeedback = RotateAbsoluteFeedback()
