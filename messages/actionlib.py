"""actionlib_msgs: the goals of an action, and their status."""

from enum import IntEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Message
from messages.std import Header, Time


class Status(IntEnum):
    """The states of a goal, as ``actionlib_msgs/GoalStatus`` numbers them."""

    PENDING = 0
    ACTIVE = 1
    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5
    PREEMPTING = 6
    RECALLING = 7
    RECALLED = 8
    LOST = 9

    @property
    def terminal(self) -> bool:
        """Whether a goal stays in this state."""
        return self in _TERMINAL


_TERMINAL = frozenset(
    (Status.PREEMPTED, Status.SUCCEEDED, Status.ABORTED, Status.REJECTED, Status.RECALLED, Status.LOST)
)


class GoalID(Message, frozen=True, kw_only=True):
    """A goal's name and when it was made. To cancel: the goal of an id, those up to a stamp, or, both empty, all."""

    ROS_TYPE: ClassVar[str] = "actionlib_msgs/GoalID"
    stamp: Time = Time()
    id: Annotated[str, Meta(max_length=255)] = ""


class GoalStatus(Message, frozen=True, kw_only=True):
    """The state of one goal, a number of ``Status``, and why it is so."""

    ROS_TYPE: ClassVar[str] = "actionlib_msgs/GoalStatus"
    goal_id: GoalID = GoalID()
    status: Annotated[int, Meta(ge=0, le=255)] = 0
    text: str = ""


class GoalStatusArray(Message, frozen=True, kw_only=True):
    """All goals that an action server follows, and those that ended within the last seconds."""

    ROS_TYPE: ClassVar[str] = "actionlib_msgs/GoalStatusArray"
    header: Header = Header()
    status_list: tuple[GoalStatus, ...] = ()
