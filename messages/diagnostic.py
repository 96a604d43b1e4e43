"""diagnostic_msgs: the state of components, for display by tools."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Message
from messages.std import Header


class KeyValue(Message, frozen=True, kw_only=True):
    """One named value."""

    ROS_TYPE: ClassVar[str] = "diagnostic_msgs/KeyValue"
    key: str = ""
    value: str = ""


OK, WARN, ERROR, STALE = 0, 1, 2, 3
"""Values of ``DiagnosticStatus.level``."""


class DiagnosticStatus(Message, frozen=True, kw_only=True):
    """The state of one component."""

    ROS_TYPE: ClassVar[str] = "diagnostic_msgs/DiagnosticStatus"
    level: Annotated[int, Meta(ge=0, le=3)] = OK
    name: str = ""
    message: str = ""
    hardware_id: str = ""
    values: tuple[KeyValue, ...] = ()


class DiagnosticArray(Message, frozen=True, kw_only=True):
    """The states of several components at one time."""

    ROS_TYPE: ClassVar[str] = "diagnostic_msgs/DiagnosticArray"
    header: Header = Header()
    status: tuple[DiagnosticStatus, ...] = ()
