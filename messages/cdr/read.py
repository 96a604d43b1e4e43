"""CDR to records or plain values: for each type, a reader is put together once from its definition."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec.inspect as kinds

from messages.base import FAULTS, Array, Message, WrongPayload, bare_decoder, encode, pack36
from messages.cdr.definition import SIZES, Definitions, Field
from messages.cdr.derive import anything, bare, fields_of, optional, packed, record_of

M = TypeVar("M", bound=Message)

Read = Callable[[bytes, int], tuple[Any, int]]
"""Reads a value that begins at a position; gives it, and where the next one begins."""

_LITTLE, _WIDE = (b"\x00\x01", b"\x00\x07"), b"\x00\x00"
_length = struct.Struct("<I").unpack_from


def plain_reader(name: str, types: Definitions) -> Callable[[bytes], dict[str, Any]]:
    """A function from CDR to a dict of plain values; it raises WrongPayload."""
    return _guarded(_fields(name, types, None))


def record_reader(record: type[M], types: Definitions, name: str = "") -> Callable[[bytes], M]:
    """A function from CDR of the type ``name`` (the record's own by default) to ``record``.

    Fields are matched by name: what the record lacks is dropped, what the type lacks has its default. It raises
    WrongPayload, also for values out of the record's bounds.
    """
    read = _guarded(_fields(name or record.ROS_TYPE, types, record))
    check = bare_decoder(record)

    def checked(data: bytes) -> M:
        message: M = read(data)
        try:
            check(encode(message))
        except FAULTS as error:
            raise WrongPayload(str(error)) from None
        return message

    return checked


def _guarded(read: Read) -> Callable[[bytes], Any]:
    def guarded(data: bytes) -> Any:
        if data[:2] not in _LITTLE:
            kind = "big-endian CDR" if data[:2] == _WIDE else f"the encapsulation {data[:4].hex() or 'nothing'}"
            raise WrongPayload(f"{kind} is not read; only little-endian CDR is")
        try:
            return read(data[4:], 0)[0]
        except (struct.error, ValueError, TypeError, IndexError) as error:
            raise WrongPayload(f"not a message of its type: {error}") from None

    return guarded


def _fields(name: str, types: Definitions, record: type[Message] | None) -> Read:
    own = fields_of(record) if record is not None else {}
    parts: list[tuple[str, Read]] = []
    for field in types[name]:
        known = own.get(field.name)
        target = known.name if known is not None else field.name if record is None else ""
        parts.append((target, _value(field, types, bare(known.type) if known is not None else None)))
    make: Callable[..., Any] = record or dict

    def fields(data: bytes, at: int) -> tuple[Any, int]:
        values = {}
        for target, read in parts:
            value, at = read(data, at)
            if target:
                values[target] = value
        return make(**values), at

    return fields


def _value(field: Field, types: Definitions, kind: kinds.Type | None) -> Read:
    """``kind`` is the type of the record's field; None for plain values."""
    if kind is None:
        return _single(field.type, types, None) if field.extent is None else _many(field, types, None, list)
    if anything(kind):
        return _then(_string, lambda text: _frozen(json.loads(text)))
    if (inner := optional(kind)) is not None:
        return _then(_many(field, types, inner, tuple), lambda found: found[0] if found else None)
    if packed(kind):
        return _then(_many(field, types, None, tuple), pack36)
    match kind:
        case kinds.VarTupleType(item_type=item):
            return _many(field, types, bare(item), tuple)
        case kinds.CustomType(cls=cls) if issubclass(cls, Array):
            return _then(_many(field, types, None, tuple), cls)
        case kinds.BytesType():
            return _then(_many(field, types, None, tuple), bytes)
    if field.extent is not None:
        raise WrongPayload(f"{field} cannot be read into a single value")
    return _single(field.type, types, kind)


def _then(read: Read, convert: Callable[[Any], Any]) -> Read:
    def converted(data: bytes, at: int) -> tuple[Any, int]:
        value, at = read(data, at)
        return convert(value), at

    return converted


def _single(kind: str, types: Definitions, target: kinds.Type | None) -> Read:
    if kind == "string":
        return _string
    if kind in SIZES:
        code, size = SIZES[kind]
        unpack = struct.Struct(f"<{code}").unpack_from

        def number(data: bytes, at: int) -> tuple[Any, int]:
            at += -at % size
            return unpack(data, at)[0], at + size

        return number
    return _fields(kind, types, None if target is None else record_of(target))


def _many(field: Field, types: Definitions, target: kinds.Type | None, make: Callable[[Any], Any]) -> Read:
    fixed = field.extent if field.extent != -1 else None
    if field.type in SIZES:
        code, size = SIZES[field.type]

        def numbers(data: bytes, at: int) -> tuple[Any, int]:
            count, at = _count(data, at) if fixed is None else (fixed, at)
            if not count:
                return make(()), at
            at += -at % size
            return make(struct.unpack_from(f"<{count}{code}", data, at)), at + count * size

        return numbers
    read = _single(field.type, types, target)

    def items(data: bytes, at: int) -> tuple[Any, int]:
        count, at = _count(data, at) if fixed is None else (fixed, at)
        found = []
        for _ in range(count):
            value, at = read(data, at)
            found.append(value)
        return make(found), at

    return items


def _count(data: bytes, at: int) -> tuple[int, int]:
    at += -at % 4
    count: int = _length(data, at)[0]
    if count > len(data) - at:
        raise ValueError(f"a length of {count} with {len(data) - at} bytes left")
    return count, at + 4


def _string(data: bytes, at: int) -> tuple[str, int]:
    at += -at % 4
    size: int = _length(data, at)[0]
    at += 4
    if at + size > len(data):
        raise ValueError(f"a text of {size} bytes with {len(data) - at} left")
    return data[at : at + max(0, size - 1)].decode(), at + size


def _frozen(value: Any) -> Any:
    return tuple(_frozen(each) for each in value) if isinstance(value, list) else value
