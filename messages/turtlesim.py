"""turtlesim: the pose of a turtle, the colour below it, and the requests of its simulation."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.actionlib import GoalID, GoalStatus
from messages.base import Finite, Message, NameStr
from messages.std import Header

Byte = Annotated[int, Meta(ge=0, le=255)]


class Pose(Message, frozen=True, kw_only=True):
    """Where a turtle is [m] on its plane, from the lower left corner, and its velocity [m/s, rad/s].

    ``theta`` is in [-pi, pi], counted from the x axis to the left.
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
    """Another turtle at a place [m, m, rad]; without a name it gets the next free one."""

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
    """The turtle to remove."""

    ROS_TYPE: ClassVar[str] = "turtlesim/Kill"
    name: NameStr = ""


class KillResponse(Message, frozen=True, kw_only=True):
    """It is removed."""

    ROS_TYPE: ClassVar[str] = "turtlesim/KillResponse"


class SetPen(Message, frozen=True, kw_only=True):
    """Colour and width [pixels] of a turtle's pen; 0 keeps the width. ``off`` other than 0 lifts the pen."""

    ROS_TYPE: ClassVar[str] = "turtlesim/SetPen"
    r: Byte = 0
    g: Byte = 0
    b: Byte = 0
    width: Byte = 0
    off: Byte = 0


class SetPenResponse(Message, frozen=True, kw_only=True):
    """The pen is set."""

    ROS_TYPE: ClassVar[str] = "turtlesim/SetPenResponse"


class TeleportAbsolute(Message, frozen=True, kw_only=True):
    """Where to put a turtle [m, m, rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportAbsolute"
    x: Finite = 0.0
    y: Finite = 0.0
    theta: Finite = 0.0


class TeleportAbsoluteResponse(Message, frozen=True, kw_only=True):
    """It is put there."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportAbsoluteResponse"


class TeleportRelative(Message, frozen=True, kw_only=True):
    """By how much to turn a turtle [rad], and then to move it ahead [m]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportRelative"
    linear: Finite = 0.0
    angular: Finite = 0.0


class TeleportRelativeResponse(Message, frozen=True, kw_only=True):
    """It is moved."""

    ROS_TYPE: ClassVar[str] = "turtlesim/TeleportRelativeResponse"


class RotateAbsoluteGoal(Message, frozen=True, kw_only=True):
    """The heading to turn to [rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteGoal"
    theta: Finite = 0.0


class RotateAbsoluteResult(Message, frozen=True, kw_only=True):
    """By how much the turtle was turned [rad], from where it is to where it was."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteResult"
    delta: Finite = 0.0


class RotateAbsoluteFeedback(Message, frozen=True, kw_only=True):
    """The angle that remains [rad]."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteFeedback"
    remaining: Finite = 0.0


class RotateAbsoluteActionGoal(Message, frozen=True, kw_only=True):
    """A goal, as it is sent to the action's topic."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteActionGoal"
    header: Header = Header()
    goal_id: GoalID = GoalID()
    goal: RotateAbsoluteGoal = RotateAbsoluteGoal()


class RotateAbsoluteActionResult(Message, frozen=True, kw_only=True):
    """How a goal ended."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteActionResult"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    result: RotateAbsoluteResult = RotateAbsoluteResult()


class RotateAbsoluteActionFeedback(Message, frozen=True, kw_only=True):
    """How far the active goal is."""

    ROS_TYPE: ClassVar[str] = "turtlesim/RotateAbsoluteActionFeedback"
    header: Header = Header()
    status: GoalStatus = GoalStatus()
    feedback: RotateAbsoluteFeedback = RotateAbsoluteFeedback()
