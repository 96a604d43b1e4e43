"""The fields of a message by their paths, ``pose.pose.position.x`` or ``ranges[90]``, and their units."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from functools import cache
from typing import Any, get_type_hints

import msgspec
from msgspec import Meta

from messages.base import Array, Message, WrongPayload
from messages.geometry import Quaternion
from messages.topics import TOPICS
from services.runtime.errors import BadInput

MAX_FIELDS = 600
"""Leaves of a message that are listed."""
MAX_ARRAY_ELEMENTS = 64
"""Elements of a list that are listed; a path reaches all of them."""
MAX_DEPTH = 16

PathStep = str | int
_PATH = re.compile(r"[A-Za-z]\w*(?:\[\d{1,7}\])*(?:\.[A-Za-z]\w*(?:\[\d{1,7}\])*)*", re.ASCII)
_STEP = re.compile(r"[A-Za-z]\w*|\d+", re.ASCII)

Scalar = bool | int | float | str | None


def parse_path(path: str) -> tuple[PathStep, ...]:
    """The steps of a path; raises BadInput."""
    if not _PATH.fullmatch(path):
        raise BadInput(f"{path[:80]!r} is no path of a field; write it as pose.pose.position.x or ranges[0]")
    steps = tuple(int(each) if each[0].isdigit() else each for each in _STEP.findall(path))
    if len(steps) > MAX_DEPTH:
        raise BadInput(f"{path[:80]!r} has {len(steps)} steps, the limit is {MAX_DEPTH}")
    return steps


def read_number(message: Any, steps: tuple[PathStep, ...]) -> float | None:
    """The number at the end of a path, bool as 0 or 1; None when there is none, or it is not finite."""
    value = message
    for step in steps:
        value = get_step(value, step)
        if value is None:
            return None
    if type(value) is float:
        return value if math.isfinite(value) else None
    return float(value) if isinstance(value, int) and abs(value) < 2**1000 else None


def get_step(value: Any, step: PathStep) -> Any:
    """The field or element that a step leads to; None when there is none."""
    if isinstance(step, int):
        if isinstance(value, Array):
            size = int(value.DTYPE[-1])
            inside = (step + 1) * size <= len(value.raw)
            return struct.unpack_from(_FORMATS[value.DTYPE], value.raw, step * size)[0] if inside else None
        return value[step] if isinstance(value, tuple | list) and step < len(value) else None
    if isinstance(value, dict):
        return value.get(step)
    if not isinstance(value, Message) or step not in _field_names(type(value)):
        return None
    try:
        return getattr(value, step)
    except WrongPayload:
        return None


def list_fields(message: Any) -> list[tuple[str, Scalar]]:
    """Paths and values of what a message holds, MAX_FIELDS of them at most."""
    found: list[tuple[str, Scalar]] = []
    for leaf in _walk(message, "", 0):
        found.append(leaf)
        if len(found) >= MAX_FIELDS:
            break
    return found


def _walk(value: Any, path: str, depth: int) -> Iterator[tuple[str, Scalar]]:
    if depth > MAX_DEPTH:
        return
    if isinstance(value, Message):
        for name in _field_names(type(value)):
            yield from _walk(get_step(value, name), f"{path}.{name}" if path else name, depth + 1)
    elif isinstance(value, dict):
        for name, each in value.items():
            if isinstance(name, str) and _PATH.fullmatch(name):
                yield from _walk(each, f"{path}.{name}" if path else name, depth + 1)
    elif isinstance(value, Array | tuple | list):
        length = len(value.raw) // int(value.DTYPE[-1]) if isinstance(value, Array) else len(value)
        for index in range(min(MAX_ARRAY_ELEMENTS, length)):
            yield from _walk(get_step(value, index), f"{path}[{index}]", depth + 1)
    elif isinstance(value, bool | int | float | str) or value is None:
        yield path, value[:200] if isinstance(value, str) else _json_scalar(value)


def _json_scalar(value: bool | int | float | None) -> Scalar:
    """As JSON can carry it."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


@cache
def _field_names(record: type[Message]) -> tuple[str, ...]:
    """The fields of a record as they are called on the wire; a rotation has its heading beside them."""
    names = tuple(each.encode_name for each in msgspec.structs.fields(record))
    return (*names, "yaw") if record is Quaternion else names


_FORMATS = {"<f8": "<d", "<f4": "<f"}


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


def field_unit(topic: str, message: Any, steps: tuple[PathStep, ...]) -> str:
    """The unit of the number at the end of a path in a message of ``topic``; empty when none is known."""
    found, value = _TOPIC_UNITS.get(topic, ""), message
    for step in steps:
        if isinstance(value, Message) and isinstance(step, str):
            found = _REP_103.get((value.ROS_TYPE, step)) or _declared_units(type(value)).get(step, "") or found
        value = get_step(value, step)
    return found


@cache
def _declared_units(record: type[Message]) -> dict[str, str]:
    """The units that the fields of a record state in their annotations."""
    found = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        for meta in getattr(hint, "__metadata__", ()):
            if isinstance(meta, Meta) and meta.extra and "unit" in meta.extra:
                found[name] = str(meta.extra["unit"])
    return found
