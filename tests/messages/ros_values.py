"""A message as a bag reader must see it, and as rounded to float32."""

from __future__ import annotations

import json
import math
from typing import Any

import msgspec
import numpy as np

from messages.base import Array, Message, pack36, unpack36
from messages.cdr.definitions import SIZES, Definitions, Field, definitions, fields_of
from messages.records import RECORDS

ANYTHING = {
    ("elea_msgs/Parameter", "value"),
    ("elea_msgs/Assignment", "value"),
    ("elea_msgs/ParameterDescription", "default"),
}
"""Fields that hold values of any type, as JSON."""


def ros_view(message: Message) -> dict[str, Any]:
    """Return a message as its ROS type: names, plain values, float32 as in ROS, zero for missing fields."""
    types = definitions(type(message))
    return _record(message, type(message).ROS_TYPE, types)


def assert_same(wanted: Any, found: Any, path: str = "") -> None:
    """Assert, field by field, that the result of ``ros_view`` equals what another library read."""
    if isinstance(wanted, dict):
        for name, value in wanted.items():
            assert_same(value, getattr(found, name), f"{path}.{name}")
    elif isinstance(wanted, list):
        assert len(found) == len(wanted), path
        for index, value in enumerate(wanted):
            assert_same(value, found[index], f"{path}[{index}]")
    elif isinstance(wanted, float) and math.isnan(wanted):
        assert math.isnan(found), path
    else:
        assert found == wanted, f"{path}: {found!r} instead of {wanted!r}"


def with_float32(message: Any) -> Any:
    """Return the message with ROS's float32 fields rounded."""
    if not isinstance(message, Message):
        return message
    types = definitions(type(message))[type(message).ROS_TYPE] if type(message).ROS_TYPE in RECORDS else ()
    widths = {field.name: field.type for field in types}
    changes: dict[str, Any] = {}
    for wire, field in fields_of(type(message)).items():
        value = getattr(message, field.name)
        if isinstance(value, float) and widths.get(wire) == "float32":
            value = _float32(value)
        elif isinstance(value, Message):
            value = with_float32(value)
        elif field.name == "packed":
            value = pack36(unpack36(value))  # as we publish it
        elif isinstance(value, tuple):
            value = tuple(with_float32(each) for each in value)
        changes[field.name] = value
    return msgspec.structs.replace(message, **changes)


def _record(message: Any, name: str, types: Definitions) -> dict[str, Any]:
    own = {wire: field.name for wire, field in fields_of(type(message)).items()}
    shown = {}
    for field in types[name]:
        if field.name in own:
            value = getattr(message, own[field.name])
            anything = (name, field.name) in ANYTHING
            shown[field.name] = json.dumps(value) if anything else _field(value, field, types)
        else:
            shown[field.name] = _zero(field, types)
    return shown


def _field(value: Any, field: Field, types: Definitions) -> Any:
    if field.extent is None:
        return _single(value, field.type, types)
    if field.bound:
        value = () if value is None else (value,)
    elif isinstance(value, Array):
        value = value.tolist()
    elif isinstance(value, msgspec.msgpack.Ext):
        value = unpack36(value)
    return [_single(each, field.type, types) for each in value]


def _single(value: Any, kind: str, types: Definitions) -> Any:
    if isinstance(value, Message):
        return _record(value, kind, types)
    return _float32(value) if kind == "float32" else value


def _zero(field: Field, types: Definitions) -> Any:
    if field.extent == -1:
        return []
    if field.type in SIZES:
        return 0
    if field.type == "string":
        return ""
    return {each.name: _zero(each, types) for each in types[field.type]}


def _float32(value: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.float32(value))
