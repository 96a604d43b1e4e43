"""Numbers, lists and units of a message's fields, for plots."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

from msgspec import inspect

from messages.base import Message, WrongPayload
from messages.topics import TOPICS
from services.runtime.field_path import FieldPath, child, field_types, is_path, leaves

MAX_FIELDS = 600
"""Leaves of a message that are listed."""
MAX_ARRAY_ELEMENTS = 64
"""Elements of a list that are listed; a path reaches all of them."""

Scalar = bool | int | float | str | None


def read_number(message: Any, path: FieldPath) -> float | None:
    """The number at the end of a path, bool as 0 or 1; None when there is none, or it is not finite."""
    value = message
    try:
        for step in path:
            value = child(value, step)
    except (LookupError, WrongPayload):
        return None
    if type(value) is float:
        return value if math.isfinite(value) else None
    return float(value) if isinstance(value, int) and abs(value) < 2**1000 else None


def list_fields(message: Any) -> list[tuple[str, Scalar]]:
    """Paths and values of what a message holds, MAX_FIELDS of them at most."""
    found = (
        (path, value[:200] if isinstance(value, str) else _json_scalar(value))
        for path, value in _leaves(message)
        if (value is None or isinstance(value, bool | int | float | str)) and is_path(path)
    )
    return list(islice(found, MAX_FIELDS))


def _leaves(message: object) -> Iterator[tuple[str, Any]]:
    """The single values of a message; bytes, as which uint8[] comes, only if they are few: else they are data."""
    for path, value in leaves(message, max_elements=MAX_ARRAY_ELEMENTS):
        if isinstance(value, bytes) and len(value) <= MAX_ARRAY_ELEMENTS:
            yield from ((f"{path}[{index}]", each) for index, each in enumerate(value))
        else:
            yield path, value


def _json_scalar(value: bool | int | float | None) -> Scalar:
    """As JSON can carry it."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


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

_TOPIC_UNITS = {each.name: each.unit for each in TOPICS if each.unit}
"""Units of topics that carry one bare number."""


def field_unit(topic: str, message: Any, path: FieldPath) -> str:
    """The unit of the number at the end of a path in a message of ``topic``; empty when none is known."""
    found, value = _TOPIC_UNITS.get(topic, ""), message
    try:
        for step in path:
            if isinstance(value, Message) and isinstance(step, str):
                found = _REP_103.get((value.ROS_TYPE, step)) or _declared_unit(type(value), step) or found
            value = child(value, step)
    except (LookupError, WrongPayload):
        pass
    return found


def _declared_unit(record: type[Message], field: str) -> str:
    """The unit that a field states in its annotation."""
    kind = field_types(record).get(field)
    return str((kind.extra or {}).get("unit", "")) if isinstance(kind, inspect.Metadata) else ""
