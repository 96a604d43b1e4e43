"""actionlib_msgs: goals of actions and their status."""

from enum import IntEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Message
from messages.std import Header, Time


class Status(IntEnum):
    """Goal states, numbered as in ``actionlib_msgs/GoalStatus``."""

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
        """Whether this state is final."""
        return self in _TERMINAL


_TERMINAL = frozenset(
    (Status.PREEMPTED, Status.SUCCEEDED, Status.ABORTED, Status.REJECTED, Status.RECALLED, Status.LOST)
)


class GoalID(Message, frozen=True, kw_only=True):
    """ID and creation time of a goal. To cancel: the goal with the ID, all up to the stamp; all if both are empty."""

    ROS_TYPE: ClassVar[str] = "actionlib_msgs/GoalID"
    stamp: Time = Time()
    id: Annotated[str, Meta(max_length=255)] = ""


class GoalStatus(Message, frozen=True, kw_only=True):
    """The state of one goal, a value of ``Status``, with an explanation."""

    ROS_TYPE: ClassVar[str] = "actionlib_msgs/GoalStatus"
    goal_id: GoalID = GoalID()
    status: Annotated[int, Meta(ge=0, le=255)] = 0
    text: str = ""


class GoalStatusArray(Message, frozen=True, kw_only=True):
    """All goals that an action server is tracking, including those that ended within the last few seconds."""

    ROS_TYPE: ClassVar[str] = "actionlib_msgs/GoalStatusArray"
    header: Header = Header()
    status_list: tuple[GoalStatus, ...] = ()
