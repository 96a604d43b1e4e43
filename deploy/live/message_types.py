"""Message types: look-up by name, the types of their fields, and field paths such as ``pose.pose.position``."""

from __future__ import annotations

import re
import types
from typing import Annotated, Any, Union, get_args, get_origin

import msgspec

from messages.base import Array, Ext, Message
from messages.records import RECORDS, UnknownRecord, record
from messages.requests import REQUESTS, Request
from messages.topics import TOPICS, Topic
from services.runtime.errors import BadInput, unknown_name


def known_topic(name: str) -> Topic[Any] | None:
    """The topic that lies under ``name`` in some namespace; of several, the one with the longest name."""
    found = [each for each in TOPICS if name == each.name or name.endswith("/" + each.name.lstrip("~/"))]
    fitting = [each for each in found if not each.name.startswith("/") or each.name == name]
    return max(fitting, key=lambda each: len(each.name), default=None)


def known_request(name: str) -> Request[Any, Any] | None:
    """The request of an absolute name; a node's own (``~name``) lies under the name of any node."""
    for each in REQUESTS:
        if each.name == name or (each.name.startswith("~") and name.endswith(f"/{each.name[1:]}")):
            return each
    return None


def known_record(type_name: str) -> type[Message] | None:
    """The record of a ROS type in either spelling, or None when this project has none."""
    return RECORDS.get(canonical_type(type_name))


def record_by_type(type_name: str) -> type[Message]:
    """The record of a ROS type in either spelling; raises BadInput with the nearest name."""
    try:
        return record(canonical_type(type_name))
    except UnknownRecord as error:
        raise BadInput(str(error)) from None


def canonical_type(type_name: str) -> str:
    """``geometry_msgs/Twist``, however it is written: ROS 2 puts ``msg`` or ``srv`` in the middle."""
    parts = type_name.split("/")
    return "/".join((parts[0], parts[2])) if len(parts) == 3 and parts[1] in ("msg", "srv") else type_name


def field_types(record: type[Message]) -> dict[str, Any]:
    """The types of a record's fields by their names on the wire, in order."""
    return {each.encode_name: each.type for each in msgspec.structs.fields(record)}


def nested_record(kind: Any) -> type[Message] | None:
    """The record that a field of this type holds, or None."""
    return next((each for each in _alternatives(kind) if isinstance(each, type) and issubclass(each, Message)), None)


def element_type(kind: Any) -> Any | None:
    """The type of a list's elements for a field that holds a list, or None."""
    for each in _alternatives(kind):
        if get_origin(each) in (tuple, list):
            return get_args(each)[0]
        if isinstance(each, type) and issubclass(each, Array | Ext):
            return float
    return None


def _alternatives(kind: Any) -> tuple[Any, ...]:
    """A type without its bounds; the alternatives, when it has some."""
    if get_origin(kind) is Annotated:
        return _alternatives(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return tuple(choice for each in get_args(kind) for choice in _alternatives(each))
    return (kind,)


FieldPath = tuple[str, ...]
"""Names of fields and numbers of elements, as written."""

_STEP = re.compile(r"[^.\[\]/]+")
_LEGAL = re.compile(r"/?[^.\[\]/]+(?:[./][^.\[\]/]+|\[-?\d+\])*")


def parse_path(text: str) -> FieldPath:
    """The steps of a path; raises BadInput."""
    if not _LEGAL.fullmatch(text):
        raise BadInput(f"{text!r} is not a field path: write it as pose.pose.position, or ranges[0]")
    return tuple(_STEP.findall(text))


def check_path(record: type[Message], path: FieldPath) -> None:
    """Refuse a path that no message of this type has, before any came; raises BadInput with the nearest name."""
    kind: Any = record
    for step in path:
        inner = nested_record(kind)
        if inner is not None:
            names = field_types(inner)
            if step not in names:
                raise unknown_name("field", step, names, f"{inner.ROS_TYPE} in {'.'.join(path)!r}")
            kind = names[step]
        elif (element := element_type(kind)) is not None:
            _element_index(step, path)
            kind = element
        elif kind is not Any:
            raise BadInput(f"{'.'.join(path)!r}: a single value has no element {step!r}")


def get_field(value: Any, path: FieldPath) -> Any:
    """What lies at the path in a message shown as plain values; raises BadInput."""
    for step in path:
        if isinstance(value, dict):
            if step not in value:
                raise unknown_name("field", step, value, f"{'.'.join(path)!r}")
            value = value[step]
        elif isinstance(value, list):
            number = _element_index(step, path)
            if not -len(value) <= number < len(value):
                raise BadInput(f"{'.'.join(path)!r}: there are {len(value)} elements, no number {number}")
            value = value[number]
        else:
            raise BadInput(f"{'.'.join(path)!r}: a single value has no element {step!r}")
    return value


def complete_path(record: type[Message], begun: str) -> list[str]:
    """The paths that go on from what was typed so far, one step further."""
    above, _, _ = begun.rpartition(".")
    kind: Any = record
    for step in above.split(".") if above else ():
        inner = nested_record(kind)
        kind = field_types(inner).get(step) if inner is not None else element_type(kind)
    inner = nested_record(kind)
    prefix = f"{above}." if above else ""
    return [f"{prefix}{name}" for name in (field_types(inner) if inner is not None else ())]


def _element_index(step: str, path: FieldPath) -> int:
    if not re.fullmatch(r"-?\d{1,9}", step):
        raise BadInput(f"{'.'.join(path)!r}: an array element is selected by its index, not by {step!r}")
    return int(step)
