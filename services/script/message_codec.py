"""Converts messages of ROS 1 classes to Elea's MessagePack maps and back, by functions compiled for each type.

On the wire a message has ROS 2's field names (``sec``, ``nanosec``, ``d`` of CameraInfo), and a header's ``seq`` as an
additional field. Values are coerced as in ROS 1's binary format, with ``struct``: integers become floats in float
fields, and a float32 is rounded. A missing field has ROS 1's default.
"""

from __future__ import annotations

import math
import re
import struct
import types
from collections.abc import Callable
from typing import Annotated, Any, Protocol

import msgspec
from msgspec import Meta

from messages.base import ARRAY_CODE, DECODE_ERRORS, Array, Ext, WrongPayload, encode, pack_array, raw_decoder
from messages.cdr.definitions import fields_of, packed, unwrap
from messages.interfaces import Catalogue, Field
from messages.interfaces.definition import SIZES
from messages.plain import array_values
from messages.records import RECORDS

CODES = {name: code for name, (code, _) in SIZES.items()} | {"bool": "B", "byte": "b"}
"""The ``struct`` codes of ROS 1's number types."""

_FLOAT_MAX = 3.4028235677973366e38
_TIMES = ("time", "duration")
_BYTES = ("uint8", "char")


class ClassSource(Protocol):
    """The source of message classes."""

    time: type
    duration: type

    def message(self, name: str) -> type:
        """Return the class of ``pkg/Type``."""
        ...


class Codec:
    """Encodes and decodes the messages of one catalogue.

    Args:
        catalogue: The definitions.
        classes: The classes of messages and times.
        slot: The attribute for a field's name.
    """

    def __init__(self, catalogue: Catalogue, classes: ClassSource, slot: Callable[[str], str]) -> None:
        self._catalogue, self._classes, self._slot = catalogue, classes, slot
        self._to_maps: dict[str, Callable[[Any], dict[str, Any]]] = {}
        self._from_structs: dict[str, Callable[[Any], Any]] = {}
        self._structs: dict[str, type] = {}

    def encoder(self, name: str) -> Callable[[Any], bytes]:
        """Return a function that encodes messages of a type as MessagePack; it raises the errors of ``struct`` and
        attributes.
        """
        to_map = self._encoding(name)
        return lambda message: encode(to_map(message))

    def decoder(self, name: str) -> Callable[[bytes], Any]:
        """Return a function that decodes messages of a type from MessagePack; it raises WrongPayload."""
        read: Callable[[bytes], Any] = raw_decoder(self._struct(name))
        build = self._decoding(name)

        def decode(payload: bytes) -> Any:
            try:
                return build(read(payload))
            except (*DECODE_ERRORS, struct.error, MemoryError) as error:
                raise WrongPayload(f"{name}: {error}") from None

        return decode

    def _encoding(self, name: str) -> Callable[[Any], dict[str, Any]]:
        if (known := self._to_maps.get(name)) is None:
            self._catalogue.closure(name)
            known = self._to_maps[name] = self._compile_encoding(name)
        return known

    def _decoding(self, name: str) -> Callable[[Any], Any]:
        if (known := self._from_structs.get(name)) is None:
            self._catalogue.closure(name)
            known = self._from_structs[name] = self._compile_decoding(name)
        return known

    def _fields(self, name: str) -> list[tuple[Field, str, str]]:
        """Return the fields of a type, each with its attribute and its name on the wire."""
        wire = wire_names(self._catalogue, name)
        return [(field, self._slot(field.name), wire[field.name]) for field in self._catalogue.message(name).fields]

    def _compile_encoding(self, name: str) -> Callable[[Any], dict[str, Any]]:
        code, paths, targets = "", list[str](), list[str]()
        names: dict[str, Any] = {"text": _text, "texts": _texts}
        items: list[str] = []
        for index, (field, slot, wire) in enumerate(self._fields(name)):
            here, own = f"m.{slot}", f"v{index}"
            if field.extent is not None:
                names[f"a{index}"] = self._items_encoding(name, field)
                items.append(f"{wire!r}: a{index}({here})")
            elif field.type in SIZES:
                code += CODES[field.type]
                paths.append(here)
                targets.append(own)
                items.append(f"{wire!r}: {f'bool({own})' if field.type == 'bool' else own}")
            elif field.type in _TIMES:
                code += "II" if field.type == "time" else "ii"
                paths += [f"{here}.secs", f"{here}.nsecs"]
                targets += [f"{own}s", f"{own}n"]
                items.append(f"{wire!r}: {{'sec': {own}s, 'nanosec': {own}n}}")
            elif field.type == "string":
                items.append(f"{wire!r}: {own} if type({own} := {here}) is str else text({own})")
            else:
                names[f"n{index}"] = self._encoding(field.type)
                items.append(f"{wire!r}: n{index}({here})")
        lines = ["def to_map(m):"]
        if code:
            layout = struct.Struct(f"<{code}")
            names |= {"pack": layout.pack, "unpack": layout.unpack}
            lines.append(f"    {', '.join(targets)}, = unpack(pack({', '.join(paths)}))")
        lines.append(f"    return {{{', '.join(items)}}}")
        return _compiled(lines, names, "to_map")

    def _items_encoding(self, name: str, field: Field) -> Callable[[Any], Any]:
        length = field.extent if field.extent is not None and field.extent >= 0 else None
        if field.type in _BYTES:
            return _bytes_encoding(length)
        if field.type in SIZES:
            return _numbers_encoding(field.type, length, is_packed(name, field.name))
        if field.type == "string":
            return _counted(_texts, length, field)
        if field.type in _TIMES:
            layout = struct.Struct("<II" if field.type == "time" else "<ii")

            def times(values: Any) -> list[dict[str, int]]:
                pairs = [layout.unpack(layout.pack(each.secs, each.nsecs)) for each in values]
                return [{"sec": sec, "nanosec": nanosec} for sec, nanosec in pairs]

            return _counted(times, length, field)
        one = self._encoding(field.type)
        return _counted(lambda values: [one(each) for each in values], length, field)

    def _struct(self, name: str) -> type:
        if (known := self._structs.get(name)) is None:
            self._catalogue.closure(name)
            fields = [(f"f{index}", *self._wire_type(field)) for index, (field, _, _) in enumerate(self._fields(name))]
            rename = {f"f{index}": wire for index, (_, _, wire) in enumerate(self._fields(name))}
            known = self._structs[name] = msgspec.defstruct(
                name.replace("/", "_"), fields, rename=rename, frozen=True, gc=False
            )
        return known

    def _wire_type(self, field: Field) -> tuple[Any, Any]:
        """Return the type of a field on the wire, and its default."""
        one, default = self._wire_single(field.type)
        if field.extent is None:
            return one, default
        many: Any = types.GenericAlias(tuple, (one, ...)) if field.type in SIZES else types.GenericAlias(list, one)
        empty: Any = msgspec.field(default_factory=list) if field.type not in SIZES else ()
        if field.type in _BYTES:
            return Ext | bytes | many, b""
        return (Ext | many if field.type in SIZES else many), empty

    def _wire_single(self, kind: str) -> tuple[Any, Any]:
        if kind in _TIMES:
            return _WireTime, _WireTime()
        if kind in SIZES:
            return _WIRE_NUMBERS[kind], False if kind == "bool" else 0.0 if kind.startswith("float") else 0
        if kind == "string":
            return str, ""
        made = self._struct(kind)
        return made, made()

    def _compile_decoding(self, name: str) -> Callable[[Any], Any]:
        names: dict[str, Any] = {
            "new": object.__new__,
            "cls": self._classes.message(name),
            "Time": self._classes.time,
            "Duration": self._classes.duration,
        }
        singles: list[tuple[str, str]] = []
        lines = ["def build(w):", "    m = new(cls)"]
        for index, (field, slot, _) in enumerate(self._fields(name)):
            here = f"w.f{index}"
            if field.extent is not None:
                names[f"a{index}"] = self._items_decoding(field)
                lines.append(f"    m.{slot} = a{index}({here})")
            elif field.type == "float32":
                singles.append((f"m.{slot}", here))
            elif field.type in _TIMES:
                kind = field.type.capitalize()
                lines += [
                    f"    m.{slot} = t = new({kind})",
                    f"    t.secs = {here}.sec",
                    f"    t.nsecs = {here}.nanosec",
                ]
            elif field.type == "byte":  # unsigned in ROS 2
                lines.append(f"    m.{slot} = ({here} + 128) % 256 - 128")
            elif field.type in SIZES or field.type == "string":
                lines.append(f"    m.{slot} = {here}")
            else:
                names[f"n{index}"] = self._decoding(field.type)
                lines.append(f"    m.{slot} = n{index}({here})")
        if singles:
            names["rounded"] = _rounding(len(singles))
            lines.append(
                f"    {', '.join(target for target, _ in singles)}, = "
                f"rounded({', '.join(source for _, source in singles)})"
            )
        return _compiled([*lines, "    return m"], names, "build")

    def _items_decoding(self, field: Field) -> Callable[[Any], Any]:
        length = field.extent if field.extent is not None and field.extent >= 0 else None
        if field.type in _BYTES:
            return _bytes_decoding(field, length)
        if field.type in SIZES:
            return _numbers_decoding(field, length)
        if field.type == "string":
            return _sized(list, field, length, "")
        if field.type in _TIMES:
            cls: Any = self._classes.time if field.type == "time" else self._classes.duration
            return _sized(lambda values: [cls(each.sec, each.nanosec) for each in values], field, length, cls)
        one = self._decoding(field.type)
        cls = self._classes.message(field.type)
        return _sized(lambda values: [one(each) for each in values], field, length, cls)


class _WireTime(msgspec.Struct, frozen=True, gc=False):
    sec: Annotated[int, Meta(ge=-(2**31), le=2**32 - 1)] = 0
    nanosec: Annotated[int, Meta(ge=0, lt=1_000_000_000)] = 0


def _wire_number(kind: str) -> Any:
    if kind == "bool":
        return bool
    if kind.startswith("float"):
        return float
    bits = 8 * SIZES[kind][1]
    signed = kind.startswith("int") or kind == "byte"
    low = -(1 << bits - 1) if signed else 0
    high = (1 << (bits if kind == "byte" or not signed else bits - 1)) - 1
    return Annotated[int, Meta(ge=low, le=high)] if high < 2**63 else Annotated[int, Meta(ge=0)]


_WIRE_NUMBERS = {kind: _wire_number(kind) for kind in SIZES}


def is_packed(name: str, field: str) -> bool:
    """Return whether our own record of a type, if there is one, encodes a field as an array instead of a list."""
    record = RECORDS.get(name)
    if record is None or (info := fields_of(record).get(field)) is None:
        return False
    kind = unwrap(info.type)
    array = getattr(kind, "cls", None)
    return packed(kind) or (isinstance(array, type) and issubclass(array, Array))


def wire_names(catalogue: Catalogue, name: str) -> dict[str, str]:
    """Return the name on the wire of each field of a ROS 1 type: ROS 2's name if that differs."""
    ros2 = {field.name for field in catalogue.message(name, 2).fields}
    found = {}
    for field in catalogue.message(name).fields:
        snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", field.name).lower()
        same = field.name in ros2 or snake not in ros2
        found[field.name] = field.name if same else snake
    return found


def _compiled(lines: list[str], names: dict[str, Any], name: str) -> Callable[[Any], Any]:
    exec("\n".join(lines), names)
    made: Callable[[Any], Any] = names[name]
    return made


def _text(value: Any) -> str:
    """Return a text; raises ROS 1's exceptions for values that are not text."""
    len(value)
    text: bytes = value.encode("utf-8")
    return text.decode()


def _texts(values: Any) -> list[str]:
    return [each if type(each) is str else _text(each) for each in values]


def _counted(encode_all: Callable[[Any], list[Any]], length: int | None, field: Field) -> Callable[[Any], list[Any]]:
    def counted(values: Any) -> list[Any]:
        found = len(values)
        if length is not None and found != length:
            raise struct.error(f"{field.name}: expected {length} items, got {found}")
        return encode_all(values)

    return counted


def _bytes_encoding(length: int | None) -> Callable[[Any], bytes]:
    def packed_bytes(value: Any) -> bytes:
        count = len(value)
        if length is not None and count != length:
            raise struct.error(f"expected {length} bytes, got {count}")
        if type(value) in (list, tuple):
            return struct.pack(f"<{count}B", *value)
        return struct.pack(f"<{count}s", value)

    return packed_bytes


def _numbers_encoding(kind: str, length: int | None, extension: bool) -> Callable[[Any], Any]:
    code, size = CODES[kind], SIZES[kind][1]
    dtype = f"<{'f' if kind.startswith('float') else 'i'}{size}"

    def numbers(values: Any) -> Any:
        count = len(values)
        layout = f"<{count if length is None else length}{code}"
        raw = struct.pack(layout, *values)
        if extension:
            return pack_array(dtype, (count,), raw)
        read = struct.unpack(layout, raw)
        return tuple(map(bool, read)) if kind == "bool" else read

    return numbers


def _numbers_decoding(field: Field, length: int | None) -> Callable[[Any], Any]:
    code = CODES[field.type]
    dtypes = {"float32": "<f4", "float64": "<f8"}
    expected_dtype, default = dtypes.get(field.type), False if field.type == "bool" else 0.0 if code in "fd" else 0
    heads: dict[int, tuple[bytes, struct.Struct]] = {}

    def array(packed_array: Ext) -> tuple[Any, ...]:
        data: Any = packed_array.data
        size = len(data)
        known = heads.get(size)
        if known is not None and packed_array.code == ARRAY_CODE and data[: len(known[0])] == known[0]:
            return known[1].unpack_from(data, len(known[0]))
        found = array_values(packed_array)
        if found is None:
            raise WrongPayload(f"{field.name}: it is not an array")
        dtype, raw_size, flat = found
        if code not in "fd" and dtype.lstrip("<>|=")[0] == "f":
            raise WrongPayload(f"{field.name}: an array of {dtype} cannot be read as {field.full_type}")
        if dtype == expected_dtype:
            if len(heads) > 64:
                heads.clear()
            heads[size] = bytes(data[: size - raw_size]), struct.Struct(f"<{len(flat)}{code}")
            return tuple(flat)
        return _coerced(flat, code)

    def numbers(values: Any) -> Any:
        found = array(values) if type(values) is Ext else _coerced(values, "f") if code == "f" else values
        if length is not None and len(found) != length:
            if not found:
                return [default] * length
            raise WrongPayload(f"{field.name} has {len(found)} values instead of {length}")
        return list(map(bool, found)) if field.type == "bool" else found

    return numbers


def _bytes_decoding(field: Field, length: int | None) -> Callable[[Any], bytes]:
    def packed_bytes(value: Any) -> bytes:
        if type(value) is not bytes:
            if type(value) is Ext:
                found = array_values(value)
                if found is None or found[0].lstrip("<>|=")[0] == "f":
                    raise WrongPayload(f"{field.name}: it is not an array of bytes")
                value = found[2]
            value = struct.pack(f"<{len(value)}B", *value)
        if length is not None and len(value) != length:
            if value:
                raise WrongPayload(f"{field.name} has {len(value)} bytes instead of {length}")
            value = bytes(length)
        read: bytes = value
        return read

    return packed_bytes


def _sized(read: Callable[[Any], list[Any]], field: Field, length: int | None, default: Any) -> Callable[[Any], Any]:
    if length is None:
        return read

    def sized(values: Any) -> list[Any]:
        if not values:
            return [default() if callable(default) else default for _ in range(length)]
        if len(values) != length:
            raise WrongPayload(f"{field.name} has {len(values)} values instead of {length}")
        return read(values)

    return sized


def _rounding(count: int) -> Callable[..., tuple[float, ...]]:
    layout = struct.Struct(f"<{count}f")
    pack, unpack = layout.pack, layout.unpack

    def rounded(*values: float) -> tuple[float, ...]:
        try:
            return unpack(pack(*values))
        except OverflowError:
            return _coerced(values, "f")

    return rounded


def _coerced(values: Any, code: str) -> tuple[Any, ...]:
    """Convert numbers as a cast to another type does; a number too large for a float32 becomes infinite."""
    layout = f"<{len(values)}{code}"
    try:
        return struct.unpack(layout, struct.pack(layout, *values))
    except OverflowError:
        inf = math.inf
        return struct.unpack(
            layout,
            struct.pack(layout, *(math.copysign(inf, each) if abs(each) >= _FLOAT_MAX else each for each in values)),
        )
