"""The table of all record classes by the name of their ROS type."""

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
from messages.errors import BadInput, nearest

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
    """No record has this ROS type; the text names the nearest one, or lists all."""


def unknown_record(ros_type: str) -> type[Message]:
    """Return a record class without fields for a type that this project does not know."""
    made = msgspec.defstruct("Unknown", [], bases=(Message,), namespace={"ROS_TYPE": ros_type}, frozen=True)
    assert issubclass(made, Message)
    return made


def record(type_name: str) -> type[Message]:
    """Return the record of a ROS type, also in ROS 2's spelling (``geometry_msgs/msg/Twist``).

    Raises UnknownRecord.
    """
    found = RECORDS.get(type_name.replace("/msg/", "/", 1))
    if found is None:
        near = nearest(type_name, RECORDS, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(sorted(RECORDS))}"
        raise UnknownRecord(f"unknown record {type_name[:80]!r}; {hint}")
    return found
