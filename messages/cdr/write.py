"""Encodes records as CDR, with writers that are composed once for each type."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Sequence
from functools import cache
from operator import attrgetter
from typing import Any

import msgspec.inspect as kinds

from messages.base import Message
from messages.cdr.definitions import (
    anything,
    definitions,
    fields_of,
    nested_record,
    optional,
    packed,
    unwrap,
)
from messages.errors import EleaError
from messages.interfaces.definition import SIZES, Definitions, Field

HEADER = b"\x00\x01\x00\x00"
"""CDR, little-endian, no options."""

_FLOAT_MAX = 3.4028235677973366e38
"""The smallest double that rounds to an infinite float."""

Op = Callable[[bytearray, Any], None]
"""Appends a part of a message to the buffer; alignment counts from the buffer's start."""


class NotWritable(EleaError, ValueError):
    """A value does not fit its ROS type; the error says which."""


@cache
def writer(record: type[Message]) -> Callable[[Message], bytes]:
    """Return a function that encodes messages of ``record`` as CDR; it raises NotWritable.

    An Odometry takes 3.7 us; ``rosbags`` takes 6.6 with the conversion to its own classes.
    """
    types = definitions(record)
    ops = _ops(record.ROS_TYPE, types, record)

    def write(message: Message) -> bytes:
        out = bytearray()
        try:
            for op in ops:
                op(out, message)
        except (struct.error, OverflowError, UnicodeEncodeError) as error:
            raise NotWritable(f"{record.ROS_TYPE}: {error}") from None
        return HEADER + out

    return write


class _Numbers:
    """Consecutive numbers at any depth of a message; ``codes`` are those of ``struct``."""

    def __init__(self) -> None:
        self.codes, self.paths = "", list[str]()

    def op(self) -> Op:
        layouts = [aligned(self.codes, start) for start in range(8)]
        get: Callable[[Any], Sequence[Any]] = attrgetter(*self.paths)
        if len(self.paths) == 1:
            path = attrgetter(self.paths[0])
            get = lambda message: (path(message),)  # noqa: E731
        codes = self.codes

        def numbers(out: bytearray, message: Any) -> None:
            values = get(message)
            try:
                out += layouts[len(out) & 7].pack(*values)
            except OverflowError:
                out += layouts[len(out) & 7].pack(*_as_floats(codes, values))

        return numbers


def aligned(codes: str, start: int) -> struct.Struct:
    """Return the layout of numbers from offset ``start`` (modulo 8) on, each aligned to its size."""
    text, at = "<", start
    for code in codes:
        size = struct.calcsize(f"<{code}")
        pad = -at % size
        text += f"{pad}x{code}" if pad else code
        at += pad + size
    return struct.Struct(text)


def _ops(name: str, types: Definitions, record: type[Message], prefix: str = "") -> list[Op]:
    """Return the operations that write a type, consecutive numbers merged; ``prefix`` is the path to its record."""
    ops: list[Op | _Numbers] = []
    _collect(ops, name, types, record, prefix)
    return [each.op() if isinstance(each, _Numbers) else each for each in ops]


def _collect(ops: list[Op | _Numbers], name: str, types: Definitions, record: type[Message], prefix: str) -> None:
    own = fields_of(record)
    if not types[name]:
        ops.append(_nothing)
    for field in types[name]:
        if (known := own.get(field.name)) is None:
            ops.append(_zero(field, types))
            continue
        kind, path = unwrap(known.type), prefix + known.name
        if field.extent is None and field.type in SIZES and not anything(kind):
            if not ops or not isinstance(ops[-1], _Numbers):
                ops.append(_Numbers())
            numbers = ops[-1]
            assert isinstance(numbers, _Numbers)
            numbers.codes += SIZES[field.type][0]
            numbers.paths.append(path)
        elif field.extent is None and (nested := nested_record(kind)) is not None:
            _collect(ops, field.type, types, nested, f"{path}.")
        else:
            ops.append(_at(path, _value(field, kind, types)))


def _at(path: str, write: Op) -> Op:
    get = attrgetter(path)
    return lambda out, message: write(out, get(message))


def _value(field: Field, kind: kinds.Type, types: Definitions) -> Op:
    """Return the operation for a field that is neither a single number nor a single record."""
    if anything(kind):
        return lambda out, value: _string(out, json.dumps(value))
    if (inner := optional(kind)) is not None:
        many = _items(field, inner, types)
        return lambda out, value: many(out, () if value is None else (value,))
    if packed(kind):
        return _packed
    match kind:
        case kinds.VarTupleType(item_type=item):
            return _items(field, unwrap(item), types)
        case kinds.CustomType() | kinds.BytesType():
            return _raw(field)
    return _string


def _items(field: Field, item: kinds.Type, types: Definitions) -> Op:
    """Return the operation for a sequence, or for a fixed-size array, which has no length prefix."""
    counted = field.extent == -1
    if field.type in SIZES:
        code, size = SIZES[field.type]

        def numbers(out: bytearray, values: Sequence[float]) -> None:
            if counted:
                _length(out, len(values))
            if values:
                out += bytes(-len(out) % size)
                try:
                    out += struct.pack(f"<{len(values)}{code}", *values)
                except OverflowError:
                    out += struct.pack(f"<{len(values)}{code}", *_as_floats(code * len(values), values))

        return numbers
    nested = nested_record(item)
    each: list[Op] = [_string] if nested is None else _ops(field.type, types, nested)

    def records(out: bytearray, values: Sequence[Any]) -> None:
        if counted:
            _length(out, len(values))
        for value in values:
            for op in each:
                op(out, value)

    return records


def _raw(field: Field) -> Op:
    """Return the operation for numbers that are already bytes."""
    size = SIZES[field.type][1]

    def raw(out: bytearray, value: Any) -> None:
        data = value if isinstance(value, bytes) else value.raw
        if field.extent == -1:
            _length(out, len(data) // size)
        if data:
            out += bytes(-len(out) % size)
            out += data

    return raw


def _packed(out: bytearray, value: Any) -> None:
    """Write 36 doubles, the last 288 bytes of their MessagePack extension."""
    out += bytes(-len(out) % 8)
    out += struct.pack("<36d", *value) if isinstance(value, tuple) else bytes(value.data)[-288:]


def _zero(field: Field, types: Definitions) -> Op:
    """Return the operation for a field that the record lacks: zero."""
    if field.extent == -1:
        return lambda out, _: _length(out, 0)
    if field.type in SIZES:
        size = SIZES[field.type][1]

        def number(out: bytearray, _: Any) -> None:
            out += bytes(-len(out) % size + size)

        once: list[Op] = [number]
    elif field.type == "string":
        once = [lambda out, _: _string(out, "")]
    else:
        once = [_zero(each, types) for each in types[field.type]] or [_nothing]
    ops = once * (1 if field.extent is None else field.extent)

    def zero(out: bytearray, message: Any) -> None:
        for op in ops:
            op(out, message)

    return zero


def _nothing(out: bytearray, _: Any) -> None:
    """Write ROS 2's byte for a type without fields, "structure_needs_at_least_one_member"."""
    out.append(0)


def _string(out: bytearray, value: str) -> None:
    data = value.encode()
    _length(out, len(data) + 1)
    out += data
    out.append(0)


def _length(out: bytearray, count: int) -> None:
    out += bytes(-len(out) % 4) + count.to_bytes(4, "little")


def _as_floats(codes: str, values: Sequence[float]) -> list[float]:
    """Replace numbers too large for a float32 by infinity, as a cast does."""
    return [
        math.copysign(math.inf, value) if code == "f" and abs(value) >= _FLOAT_MAX else value
        for code, value in zip(codes, values, strict=True)
    ]
