"""The shape of a record's fields: which are records themselves, which are lists, and of what."""

from __future__ import annotations

import types
from typing import Annotated, Any, Union, get_args, get_origin

import msgspec

from messages.base import Array, Ext, Message


def fields_of(record: type[Message]) -> dict[str, Any]:
    """The types of a record's fields by their names on the wire, in order."""
    return {each.encode_name: each.type for each in msgspec.structs.fields(record)}


def record_in(kind: Any) -> type[Message] | None:
    """The record that a field of this type holds, or None."""
    return next((each for each in _choices(kind) if isinstance(each, type) and issubclass(each, Message)), None)


def element_in(kind: Any) -> Any | None:
    """The type of a list's elements for a field that holds a list, or None."""
    for each in _choices(kind):
        if get_origin(each) in (tuple, list):
            return get_args(each)[0]
        if isinstance(each, type) and issubclass(each, Array | Ext):
            return float
    return None


def _choices(kind: Any) -> tuple[Any, ...]:
    """A type without its bounds; the alternatives, when it has some."""
    if get_origin(kind) is Annotated:
        return _choices(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return tuple(choice for each in get_args(kind) for choice in _choices(each))
    return (kind,)
