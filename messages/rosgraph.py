"""rosgraph_msgs: the clock and the log."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Count, Message
from messages.std import Header, Time


class Clock(Message, frozen=True, kw_only=True):
    """Simulation time. Beyond ROS: the count of physics steps, the epoch (one more at each reset) and the pause."""

    ROS_TYPE: ClassVar[str] = "rosgraph_msgs/Clock"
    clock: Time = Time()
    tick: Count = 0
    epoch: Count = 0
    paused: bool = False


DEBUG, INFO, WARN, ERROR, FATAL = 1, 2, 4, 8, 16
"""The levels of a Log, as in ROS."""


class Log(Message, frozen=True, kw_only=True):
    """One line of a node's log."""

    ROS_TYPE: ClassVar[str] = "rosgraph_msgs/Log"
    header: Header = Header()
    level: Annotated[int, Meta(ge=0, le=255)] = INFO
    name: str = ""
    msg: str = ""
    file: str = ""
    function: str = ""
    line: Annotated[int, Meta(ge=0, le=2**31)] = 0
    topics: tuple[str, ...] = ()
