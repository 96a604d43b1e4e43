"""The unit of a field, for the axes of plots: as the record declares it, else as REP 103 has it."""

from __future__ import annotations

from functools import cache
from typing import Any, get_type_hints

from msgspec import Meta

from messages.base import Message
from messages.topics import TOPICS
from services.panel.fields import Step, descend

_REP_103 = {
    ("geometry_msgs/Twist", "linear"): "m/s",
    ("geometry_msgs/Twist", "angular"): "rad/s",
    ("geometry_msgs/Pose", "position"): "m",
    ("geometry_msgs/Quaternion", "yaw"): "rad",
    ("geometry_msgs/Transform", "translation"): "m",
    ("geometry_msgs/Wrench", "force"): "N",
    ("geometry_msgs/Wrench", "torque"): "N m",
    ("sensor_msgs/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/Imu", "linear_acceleration"): "m/s²",
    ("sensor_msgs/JointState", "position"): "rad",
    ("sensor_msgs/JointState", "velocity"): "rad/s",
    ("sensor_msgs/JointState", "effort"): "N m",
    ("sensor_msgs/LaserScan", "ranges"): "m",
    ("sensor_msgs/Range", "range"): "m",
    ("sensor_msgs/PointCloud", "points"): "m",
}
"""Units of fields whose type is used for several quantities, by ROS type and field."""

_BARE = {each.name: each.unit for each in TOPICS if each.unit}
"""Units of topics that carry one bare number."""


def unit(topic: str, message: Any, steps: tuple[Step, ...]) -> str:
    """The unit of the number at the end of a path in a message of ``topic``; empty when none is known."""
    found, value = _BARE.get(topic, ""), message
    for step in steps:
        if isinstance(value, Message) and isinstance(step, str):
            found = _REP_103.get((value.ROS_TYPE, step)) or _declared(type(value)).get(step, "") or found
        value = descend(value, step)
    return found


@cache
def _declared(record: type[Message]) -> dict[str, str]:
    """The units that the fields of a record state in their annotations."""
    found = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        for meta in getattr(hint, "__metadata__", ()):
            if isinstance(meta, Meta) and meta.extra and "unit" in meta.extra:
                found[name] = str(meta.extra["unit"])
    return found
