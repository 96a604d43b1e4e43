"""Decodes a payload of any type, known or not, to plain values: dicts, lists, text, numbers, bools, bytes."""

from __future__ import annotations

import math
import struct
from typing import Any

from messages.base import ARRAY_CODE, MOST_DIMENSIONS, Ext, Message, WrongPayload, decoder, encode

_FORMATS = {
    "f2": "e",
    "f4": "f",
    "f8": "d",
    "i1": "b",
    "i2": "h",
    "i4": "i",
    "i8": "q",
    "u1": "B",
    "u2": "H",
    "u4": "I",
    "u8": "Q",
    "b1": "?",
}
"""``struct`` codes by numpy's element kind and size."""

_decode = decoder(Any)
_parts = decoder(tuple[str, tuple[int, ...], bytes])


def plain(payload: bytes) -> Any:
    """Decode a MessagePack payload without its type; raises WrongPayload if it is not exactly one value.

    The array extension becomes nested lists of its shape, keys become text. An unknown extension is shown as
    ``{"extension": code, "data": bytes}``, a timestamp as text.
    """
    try:
        return _plain(_decode(payload))
    except RecursionError:
        raise WrongPayload("it is nested too deeply") from None


def plain_record(message: Message) -> Any:
    """Return the fields of a record by their names on the wire, in the form of ``plain``."""
    return plain(encode(message))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {each if isinstance(each, str) else str(each): _plain(inner) for each, inner in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, Ext):
        listed = _array(value)
        return {"extension": value.code, "data": bytes(value.data)} if listed is None else listed
    return value if value is None or isinstance(value, str | bool | int | float | bytes) else str(value)


def array_values(packed: Ext) -> tuple[str, int, list[Any]] | None:
    """Return dtype, size [bytes] and flat values of a packed array; None if it cannot be decoded."""
    found = _array_parts(packed)
    return None if found is None else (found[0], found[2], found[3])


def _array(packed: Ext) -> Any:
    """Return the nested lists of an array; None if it cannot be decoded."""
    found = _array_parts(packed)
    return None if found is None else _folded(found[3], found[1])


def _array_parts(packed: Ext) -> tuple[str, tuple[int, ...], int, list[Any]] | None:
    """Return dtype, shape, size [bytes] and flat values of an array; None if it cannot be decoded."""
    if packed.code != ARRAY_CODE:
        return None
    try:
        dtype, shape, raw = _parts(bytes(packed.data))
    except WrongPayload:
        return None
    format_, order = _FORMATS.get(dtype.lstrip("<>|=")), ">" if dtype.startswith(">") else "<"
    if format_ is None or len(shape) > MOST_DIMENSIONS or any(extent < 0 for extent in shape):
        return None
    if math.prod(shape) * struct.calcsize(format_) != len(raw):
        return None
    flat = struct.unpack(f"{order}{len(raw) // struct.calcsize(format_)}{format_}", raw)
    return dtype, shape, len(raw), list(flat)


def _folded(values: list[Any], shape: tuple[int, ...]) -> Any:
    """Nest the values by shape; an array without values becomes an empty list, whatever its shape."""
    if not shape:
        return values[0]
    for extent in reversed(shape[1:] if values else ()):
        values = [values[at : at + extent] for at in range(0, len(values), extent)]
    return values
