"""The table of all record classes by the name of their ROS type."""

from functools import lru_cache

import msgspec

from messages import (
    actionlib,
    control,
    controllers,
    diagnostic,
    elea,
    gazebo,
    gazebo_msgs,
    geometry,
    joints,
    nav,
    parameters,
    requests,
    rosgraph,
    rosparam,
    sensor,
    simulation,
    std,
    std_srvs,
    tf,
    trajectory,
    turtlesim,
    visualization,
)
from messages.base import Message
from messages.errors import BadInput

_MODULES = (
    std,
    geometry,
    nav,
    sensor,
    tf,
    rosgraph,
    diagnostic,
    trajectory,
    actionlib,
    control,
    controllers,
    elea,
    gazebo,
    gazebo_msgs,
    joints,
    parameters,
    rosparam,
    simulation,
    visualization,
    std_srvs,
    turtlesim,
    requests,
)

RECORDS: dict[str, type[Message]] = {
    each.ROS_TYPE: each
    for module in _MODULES
    for each in vars(module).values()
    if isinstance(each, type) and issubclass(each, Message) and each.__module__ == module.__name__
}
"""Every record of this project by its ROS type, e.g. ``geometry_msgs/Twist``."""


class UnknownRecord(BadInput, LookupError):
    """No record has this ROS type; the text names similar ones."""


@lru_cache(maxsize=1024)
def unknown_record(ros_type: str) -> type[Message]:
    """Return a record class without fields for a type that this project does not know."""
    made = msgspec.defstruct("Unknown", [], bases=(Message,), namespace={"ROS_TYPE": ros_type}, frozen=True)
    assert issubclass(made, Message)
    return made
