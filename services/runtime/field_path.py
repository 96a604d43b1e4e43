"""Field paths such as ``pose.pose.position.x`` or ``ranges[0]``: parse, check against a type, follow, list."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from msgspec import inspect

from messages.base import Array, Ext, Message, unpack36
from messages.geometry import Quaternion
from services.runtime.errors import BadInput, unknown_name

FieldPath = tuple[str | int, ...]
"""Names of fields and indices of elements, from the outside in; a negative index counts from the end."""

MAX_DEPTH = 32
"""Maximum steps of a path; a value nested deeper is listed as one leaf."""

_STEP = re.compile(r"[^.\[\]/]+")
_PATH = re.compile(r"/?[^.\[\]/]+(?:[./][^.\[\]/]+|\[-?\d+\])*")
_INDEX = re.compile(r"-?\d{1,9}", re.ASCII)


def parse_path(text: str) -> FieldPath:
    """Parse a path into its steps; also accepts rostopic's ``pose/pose/position`` and ``ranges.0``.

    Raises:
        BadInput: The text is not a path, or has more than MAX_DEPTH steps.
    """
    if not _PATH.fullmatch(text):
        raise BadInput(f"{text[:80]!r} is not a field path: write it as pose.pose.position, or ranges[0]")
    steps = _STEP.findall(text)
    if len(steps) > MAX_DEPTH:
        raise BadInput(f"{text[:80]!r} has {len(steps)} steps, the limit is {MAX_DEPTH}")
    return tuple(int(each) if _INDEX.fullmatch(each) else each for each in steps)


def is_path(text: str) -> bool:
    """Return whether ``parse_path`` accepts a text; field names of unknown messages may contain a dot or a bracket."""
    return _PATH.fullmatch(text) is not None


def format_path(path: FieldPath) -> str:
    """Format a path as text that ``parse_path`` accepts."""
    return ".".join(map(str, path))


@cache
def field_types(record: type[Message]) -> dict[str, inspect.Type]:
    """Return the types of a record's fields by their names on the wire, in order."""
    described = inspect.type_info(record)
    assert isinstance(described, inspect.StructType)
    return {each.encode_name: each.type for each in described.fields}


def nested_record(kind: inspect.Type) -> type[Message] | None:
    """Return the record that a field of this type contains, or None."""
    classes = (each.cls for each in _alternatives(kind) if isinstance(each, inspect.StructType))
    return next((each for each in classes if issubclass(each, Message)), None)


def element_type(kind: inspect.Type) -> inspect.Type | None:
    """Return the element type of a field that contains a list, else None."""
    for each in _alternatives(kind):
        if isinstance(each, inspect.ListType | inspect.VarTupleType):
            return each.item_type
        if isinstance(each, inspect.TupleType):
            return each.item_types[0]
        if isinstance(each, inspect.ExtType) or (
            isinstance(each, inspect.CustomType) and issubclass(each.cls, Array | Ext)
        ):
            return inspect.FloatType()
    return None


def _alternatives(kind: inspect.Type) -> tuple[inspect.Type, ...]:
    """Return a type without its bounds; for a union, all its alternatives."""
    if isinstance(kind, inspect.Metadata):
        return _alternatives(kind.type)
    if isinstance(kind, inspect.UnionType):
        return tuple(choice for each in kind.types for choice in _alternatives(each))
    return (kind,)


def check_path(record: type[Message], path: FieldPath) -> None:
    """Check that messages of a type can have a path.

    Raises:
        BadInput: They cannot; with the nearest name and the alternatives.
    """
    kind = inspect.type_info(record)
    for step in path:
        inner = nested_record(kind)
        if inner is not None:
            names = field_types(inner)
            if step not in names:
                raise unknown_name("field", str(step), names, f"{inner.ROS_TYPE} in {format_path(path)!r}")
            kind = names[str(step)]
        elif (element := element_type(kind)) is not None:
            if not isinstance(step, int):
                raise _not_an_index(step, path)
            kind = element
        elif not isinstance(kind, inspect.AnyType):
            raise _no_element(step, path)


def complete_path(record: type[Message], begun: str) -> list[str]:
    """Return the completions of a partly typed path by one step."""
    above, _, _ = begun.rpartition(".")
    kind: inspect.Type | None = inspect.type_info(record)
    for step in above.split(".") if above else ():
        inner = nested_record(kind) if kind is not None else None
        kind = field_types(inner).get(step) if inner is not None else element_type(kind) if kind is not None else None
    inner = nested_record(kind) if kind is not None else None
    prefix = f"{above}." if above else ""
    return [f"{prefix}{name}" for name in (field_types(inner) if inner is not None else ())]


def get_field(value: Any, path: FieldPath) -> Any:
    """Return the value at a path of a message, given as a record or as plain dicts and lists.

    Raises:
        BadInput: The message has no such field; with the nearest name and the alternatives.
    """
    for step in path:
        try:
            value = child(value, step)
        except LookupError:
            raise _missing(value, step, path) from None
    return value


def child(value: Any, step: str | int) -> Any:
    """Return the field or element at one step of a path. A Quaternion also has the field ``yaw`` [rad].

    Raises:
        LookupError: There is no such field or element.
        WrongPayload: The value is a covariance that cannot be unpacked.
    """
    if isinstance(value, dict):
        return value[str(step)]
    if isinstance(value, Message):
        if step in field_types(type(value)) or (step == "yaw" and type(value) is Quaternion):
            return getattr(value, str(step))
    elif isinstance(step, int):
        if isinstance(value, Ext):
            value = unpack36(value)
        if isinstance(value, list | tuple | bytes) or (isinstance(value, Array) and value.shape):
            return value[step]
    raise LookupError(step)


def leaves(
    value: Any, path: str = "", max_elements: int | None = None, lengths: bool = False, depth: int = MAX_DEPTH
) -> Iterator[tuple[str, Any]]:
    """Yield the single values of a message with their paths, such as ``pose.position.x`` or ``ranges[3]``.

    Args:
        value: A record, or plain dicts and lists.
        path: The path of ``value`` itself.
        max_elements: Maximum elements of one list, further ones are left out; None for all.
        lengths: For a list with more elements, yield only its length, as ``ranges.length``.
        depth: Levels of nesting to follow; values nested deeper are yielded whole.
    """
    if isinstance(value, dict | Message) and depth:
        names = value if isinstance(value, dict) else field_types(type(value))
        for name in names:
            inner = value[name] if isinstance(value, dict) else getattr(value, name)
            yield from leaves(inner, f"{path}.{name}" if path else str(name), max_elements, lengths, depth - 1)
        if type(value) is Quaternion:
            yield f"{path}.yaw" if path else "yaw", value.yaw
    elif depth and (isinstance(value, list | tuple) or (isinstance(value, Array) and value.shape)):
        if lengths and max_elements is not None and len(value) > max_elements:
            yield f"{path}.length", len(value)
            return
        for index, inner in enumerate(value[:max_elements]):
            yield from leaves(inner, f"{path}[{index}]", max_elements, lengths, depth - 1)
    else:
        yield path, value


def _missing(value: Any, step: str | int, path: FieldPath) -> BadInput:
    """Return the error for a missing field or element."""
    if isinstance(value, dict | Message):
        return unknown_name(
            "field",
            str(step),
            map(str, value if isinstance(value, dict) else field_types(type(value))),
            f"{format_path(path)!r}",
        )
    if not isinstance(value, list | tuple | Array):
        return _no_element(step, path)
    if not isinstance(step, int):
        return _not_an_index(step, path)
    return BadInput(f"{format_path(path)!r}: there are {len(value)} elements, no number {step}")


def _no_element(step: str | int, path: FieldPath) -> BadInput:
    return BadInput(f"{format_path(path)!r}: a single value has no element {str(step)!r}")


def _not_an_index(step: str, path: FieldPath) -> BadInput:
    return BadInput(f"{format_path(path)!r}: an array element is selected by its index, not by {step!r}")
