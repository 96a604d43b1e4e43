"""Decodes CDR to records or plain values, with readers that are composed once for each type and encapsulation."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import msgspec.inspect as kinds

from messages.base import DECODE_ERRORS, Array, Message, WrongPayload, encode, pack36, raw_decoder
from messages.cdr.definitions import (
    anything,
    fields_of,
    minimum_size,
    nested_record,
    optional,
    packed,
    unwrap,
)
from messages.interfaces.definition import SIZES, Definitions, Field

M = TypeVar("M", bound=Message)

Read = Callable[[bytes, int], tuple[Any, int]]
"""Reads the value at an offset; returns it and the offset after it."""

LARGEST_READ = 1 << 26
"""Maximum size [bytes] of a message to decode; each of its numbers takes 8 to 32 bytes of memory."""


class Encoding(NamedTuple):
    """The layout of values in an encapsulation, from OMG's RTPS 2.5 (10.5) and DDS-XTypes 1.3 (7.4.3).

    ``order`` is the byte order code of ``struct``. Numbers are aligned to their size, at most ``widest`` bytes. In
    XCDR2, a byte count precedes each array of non-primitive elements (``sized_arrays``), and in its delimited form each
    structure (``sized_structs``).
    """

    order: str
    widest: int = 8
    sized_arrays: bool = False
    sized_structs: bool = False


ENCODINGS = {
    b"\x00\x00": Encoding(">"),
    b"\x00\x01": Encoding("<"),
    b"\x00\x06": Encoding(">", 4, sized_arrays=True),
    b"\x00\x07": Encoding("<", 4, sized_arrays=True),
    b"\x00\x08": Encoding(">", 4, sized_arrays=True, sized_structs=True),
    b"\x00\x09": Encoding("<", 4, sized_arrays=True, sized_structs=True),
}
"""Encodings by the first two bytes of a message: CDR, XCDR2 and delimited XCDR2, each big- and little-endian."""
_LISTS = (b"\x00\x02", b"\x00\x03", b"\x00\x0a", b"\x00\x0b")
_COMPRESSED = (b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18")


def plain_reader(name: str, types: Definitions) -> Callable[[bytes], dict[str, Any]]:
    """Return a function that decodes CDR to a dict of plain values; it raises WrongPayload."""
    return _guarded(name, types, None)


def record_reader(record: type[M], types: Definitions, name: str = "") -> Callable[[bytes], M]:
    """Return a function that decodes CDR of the type ``name`` (default: the record's own) to ``record``.

    Fields are matched by name: those that the record lacks are dropped, those that the type lacks keep their defaults.
    The function raises WrongPayload, also for values outside the record's bounds.
    """
    read = _guarded(name or record.ROS_TYPE, types, record)
    check = raw_decoder(record)

    def checked(data: bytes) -> M:
        message: M = read(data)
        try:
            check(encode(message))
        except DECODE_ERRORS as error:
            raise WrongPayload(str(error)) from None
        return message

    return checked


def _guarded(name: str, types: Definitions, record: type[Message] | None) -> Callable[[bytes], Any]:
    made: dict[bytes, Read] = {}

    def guarded(data: bytes) -> Any:
        kind = data[:2]
        if (read := made.get(kind)) is None:
            if (encoding := ENCODINGS.get(kind)) is None:
                raise WrongPayload(_unread(data[:4]))
            read = made[kind] = _Readers(types, encoding).message_reader(name, record)
        if len(data) > LARGEST_READ:
            raise WrongPayload(f"it has {len(data)} bytes, the limit for decoding is {LARGEST_READ}")
        try:
            return read(data[4:], 0)[0]
        except (struct.error, ValueError, TypeError, IndexError, OverflowError, RecursionError) as error:
            raise WrongPayload(f"not a message of its type: {error}") from None

    return guarded


def _unread(head: bytes) -> str:
    """Explain why a message with these first bytes cannot be decoded."""
    if head in _COMPRESSED:
        return (
            "it is individually compressed (rosbag2's compression mode MESSAGE): "
            "rewrite the bag without it, with 'ros2 bag convert'"
        )
    if head[:2] in _LISTS:
        return f"the encapsulation {head.hex()} is a parameter list (PL_CDR), whose member IDs ROS definitions lack"
    return (
        f"the encapsulation {head.hex() or 'nothing'} is not supported; plain and delimited CDR and XCDR2 are: "
        f"{', '.join(each.hex() for each in ENCODINGS)}"
    )


class _Readers:
    """Composes the readers of one encoding, one for each type and record."""

    def __init__(self, types: Definitions, encoding: Encoding) -> None:
        self._types, self._encoding = types, encoding
        self._length = struct.Struct(f"{encoding.order}I").unpack_from
        self._made: dict[tuple[str, type[Message] | None], Read] = {}

    def message_reader(self, name: str, record: type[Message] | None) -> Read:
        """Return the reader of a whole message; a type without fields may lack the byte that ROS 2 sends for it."""
        if not self._types[name]:
            make: Callable[[], Any] = record or dict
            return lambda data, at: (make(), at)
        return self._struct(name, record)

    def _struct(self, name: str, record: type[Message] | None) -> Read:
        if (made := self._made.get((name, record))) is None:
            made = self._made[name, record] = self._sized(self._fields(name, record), self._encoding.sized_structs)
        return made

    def _fields(self, name: str, record: type[Message] | None) -> Read:
        own = fields_of(record) if record is not None else {}
        parts: list[tuple[str, Read]] = []
        for field in self._types[name]:
            known = own.get(field.name)
            target = known.name if known is not None else field.name if record is None else ""
            parts.append((target, self._value(field, unwrap(known.type) if known is not None else None)))
        if not parts:
            # ROS 2 sends a byte for a type without fields, "structure_needs_at_least_one_member".
            parts.append(("", self._number("uint8")))
        make: Callable[..., Any] = record or dict

        def fields(data: bytes, at: int) -> tuple[Any, int]:
            values = {}
            for target, read in parts:
                value, at = read(data, at)
                if target:
                    values[target] = value
            return make(**values), at

        return fields

    def _value(self, field: Field, kind: kinds.Type | None) -> Read:
        """Return the reader of a field; ``kind`` is the type of the record's field, None for plain values."""
        if kind is None:
            return self._single(field.type, None) if field.extent is None else self._many(field, None, list)
        if anything(kind):
            return _converted(self._string, lambda text: _frozen(json.loads(text)))
        if (inner := optional(kind)) is not None:
            return _converted(self._many(field, inner, tuple), lambda found: found[0] if found else None)
        if packed(kind):
            return _converted(self._many(field, None, tuple), pack36)
        match kind:
            case kinds.VarTupleType(item_type=item):
                return self._many(field, unwrap(item), tuple)
            case kinds.CustomType(cls=cls) if issubclass(cls, Array):
                return _converted(self._many(field, None, tuple), cls)
            case kinds.BytesType():
                return _converted(self._many(field, None, tuple), bytes)
        if field.extent is not None:
            raise WrongPayload(f"{field} cannot be read into a single value")
        return self._single(field.type, kind)

    def _single(self, kind: str, target: kinds.Type | None) -> Read:
        if kind == "string":
            return self._string
        if kind in SIZES:
            return self._number(kind)
        return self._struct(kind, None if target is None else nested_record(target))

    def _number(self, kind: str) -> Read:
        code, size = SIZES[kind]
        unpack = struct.Struct(f"{self._encoding.order}{code}").unpack_from
        aligned = min(size, self._encoding.widest)

        def number(data: bytes, at: int) -> tuple[Any, int]:
            at += -at % aligned
            return unpack(data, at)[0], at + size

        return number

    def _many(self, field: Field, target: kinds.Type | None, make: Callable[[Any], Any]) -> Read:
        fixed = field.extent if field.extent != -1 else None
        if field.type in SIZES:
            code, size = SIZES[field.type]
            order, aligned = self._encoding.order, min(size, self._encoding.widest)

            def numbers(data: bytes, at: int) -> tuple[Any, int]:
                count, at = self._count(data, at, field, size) if fixed is None else (fixed, at)
                if not count:
                    return make(()), at
                at += -at % aligned
                if code == "B" and at + count <= len(data):
                    return make(data[at : at + count]), at + count
                return make(struct.unpack_from(f"{order}{count}{code}", data, at)), at + count * size

            return numbers
        read = self._single(field.type, target)
        each = minimum_size(field.type, self._types)

        def items(data: bytes, at: int) -> tuple[Any, int]:
            count, at = self._count(data, at, field, each) if fixed is None else (fixed, at)
            if count * each > len(data) - at:
                raise ValueError(f"{field}: {count} of at least {each} bytes each, with {len(data) - at} bytes left")
            found = []
            for _ in range(count):
                value, at = read(data, at)
                found.append(value)
            return make(found), at

        return self._sized(items, self._encoding.sized_arrays, exact=True)

    def _sized(self, read: Read, sized: bool, exact: bool = False) -> Read:
        """Read a preceding byte count if ``sized``; unless ``exact``, skip bytes after the known fields."""
        if not sized:
            return read

        def sized_value(data: bytes, at: int) -> tuple[Any, int]:
            at += -at % 4
            end = at + 4 + self._length(data, at)[0]
            if end > len(data):
                raise ValueError(f"a part of {end - at - 4} bytes with {len(data) - at - 4} left")
            value, at = read(data, at + 4)
            if at > end or (exact and at < end):
                raise ValueError(f"a part ends at byte {at} instead of {end}")
            return value, end

        return sized_value

    def _count(self, data: bytes, at: int, field: Field, size: int) -> tuple[int, int]:
        at += -at % 4
        count: int = self._length(data, at)[0]
        if count * size > len(data) - at - 4:
            raise ValueError(f"{field}: a length of {count} with {len(data) - at - 4} bytes left")
        if field.bound and count > field.bound:
            raise ValueError(f"{field}: a length of {count}")
        return count, at + 4

    def _string(self, data: bytes, at: int) -> tuple[str, int]:
        at += -at % 4
        size: int = self._length(data, at)[0]
        at += 4
        if at + size > len(data):
            raise ValueError(f"a text of {size} bytes with {len(data) - at} left")
        return data[at : at + max(0, size - 1)].decode(), at + size


def _converted(read: Read, convert: Callable[[Any], Any]) -> Read:
    def converted(data: bytes, at: int) -> tuple[Any, int]:
        value, at = read(data, at)
        return convert(value), at

    return converted


def _frozen(value: Any) -> Any:
    return tuple(_frozen(each) for each in value) if isinstance(value, list) else value
