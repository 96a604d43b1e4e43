"""The ROS 2 definition of every record: the standard one, or one made from the record's fields."""

from __future__ import annotations

from functools import cache

import msgspec.inspect as kinds

from messages.base import Array, Float32Array, Message
from messages.cdr.definition import Definitions, Field, closure, fields_in
from messages.cdr.standard import STANDARD

_WIDTHS = (("uint8", 0, 2**8 - 1), ("uint32", 0, 2**32 - 1), ("int32", -(2**31), 2**31 - 1))


@cache
def standard() -> Definitions:
    """ROS 2's own types, by name."""
    return {name: fields_in(name, fields.split("; ") if fields else []) for name, fields in STANDARD.items()}


@cache
def definitions(record: type[Message]) -> Definitions:
    """The type of a record and those that it is made of, by name."""
    found = dict(standard())
    _derive(record, found)
    return {name: found[name] for name in closure(record.ROS_TYPE, found)}


def fields_of(record: type[Message]) -> dict[str, kinds.Field]:
    """The fields of a record, by their names on the wire."""
    info = kinds.type_info(record)
    assert isinstance(info, kinds.StructType)
    return {field.encode_name: field for field in info.fields}


def bare(kind: kinds.Type) -> kinds.Type:
    """A field's type without unit and description."""
    return bare(kind.type) if isinstance(kind, kinds.Metadata) else kind


def record_of(kind: kinds.Type) -> type[Message] | None:
    """The record that a field holds, if it holds one."""
    return kind.cls if isinstance(kind, kinds.StructType) and issubclass(kind.cls, Message) else None


def optional(kind: kinds.Type) -> kinds.Type | None:
    """``X`` of ``X | None``; None for every other type."""
    if isinstance(kind, kinds.UnionType) and len(kind.types) == 2:
        rest = [each for each in kind.types if not isinstance(each, kinds.NoneType)]
        return bare(rest[0]) if len(rest) == 1 else None
    return None


def anything(kind: kinds.Type) -> bool:
    """Whether a field holds a parameter's value: of several types, known only when it comes."""
    return isinstance(kind, kinds.UnionType) and optional(kind) is None and not packed(kind)


def packed(kind: kinds.Type) -> bool:
    """Whether a field is a ``Packed36``."""
    return isinstance(kind, kinds.UnionType) and any(isinstance(each, kinds.ExtType) for each in kind.types)


def _derive(record: type[Message], found: dict[str, tuple[Field, ...]]) -> None:
    if record.ROS_TYPE in found:
        return
    found[record.ROS_TYPE] = tuple(_field(name, bare(each.type), found) for name, each in fields_of(record).items())


def _field(name: str, kind: kinds.Type, found: dict[str, tuple[Field, ...]]) -> Field:
    if (inner := optional(kind)) is not None:
        return Field(name, _single(inner, found), -1, 1)
    match kind:
        case kinds.VarTupleType(item_type=item, min_length=low, max_length=high):
            return Field(name, _single(bare(item), found), low if low is not None and low == high else -1)
        case kinds.CustomType(cls=cls) if issubclass(cls, Array):
            return Field(name, "float32" if issubclass(cls, Float32Array) else "float64", -1)
        case kinds.BytesType():
            return Field(name, "uint8", -1)
    if packed(kind):
        return Field(name, "float64", 36)
    return Field(name, _single(kind, found))


def _single(kind: kinds.Type, found: dict[str, tuple[Field, ...]]) -> str:
    if (nested := record_of(kind)) is not None:
        _derive(nested, found)
        return nested.ROS_TYPE
    match kind:
        case kinds.BoolType():
            return "bool"
        case kinds.IntType(ge=low, le=high):
            return next((name for name, least, most in _WIDTHS if _within(low, high, least, most)), "int64")
        case kinds.FloatType():
            return "float64"
        case kinds.StrType() | kinds.LiteralType():
            return "string"
    if anything(kind):
        return "string"
    raise TypeError(f"no ROS type for a field of {kind}")


def _within(low: int | None, high: int | None, least: int, most: int) -> bool:
    return low is not None and high is not None and least <= low and high <= most
