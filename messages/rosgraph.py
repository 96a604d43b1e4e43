"""rosgraph_msgs: the clock and the log."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Count, Message
from messages.std import Header, Time


class Clock(Message, frozen=True, kw_only=True):
    """Simulation time. Beyond ROS: the number of physics steps, the epoch (incremented at each reset) and the pause."""

    ROS_TYPE: ClassVar[str] = "rosgraph_msgs/Clock"
    clock: Time = Time()
    tick: Count = 0
    epoch: Count = 0
    paused: bool = False


DEBUG, INFO, WARN, ERROR, FATAL = 1, 2, 4, 8, 16
"""Log levels, as in ROS 1."""


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
