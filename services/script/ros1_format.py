"""ROS 1's binary format: little-endian, without padding, lengths as uint32."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from messages.interfaces import Catalogue, Field
from messages.interfaces.definition import SIZES
from services.script.message_codec import CODES, ClassSource

Write = Callable[[bytearray, Any], None]
Read = Callable[[bytes, int], tuple[Any, int]]
_LENGTH = struct.Struct("<I")


class Ros1Format:
    """Writers and readers of message types, compiled once for each.

    Args:
        catalogue: The definitions.
        classes: The classes of messages and times.
        slot: The attribute for a field's name.
    """

    def __init__(self, catalogue: Catalogue, classes: ClassSource, slot: Callable[[str], str]) -> None:
        self._catalogue, self._classes, self._slot = catalogue, classes, slot
        self._writers: dict[str, list[tuple[str, Write]]] = {}
        self._readers: dict[str, list[tuple[str, Read]]] = {}

    def writer(self, name: str) -> Callable[[Any], bytes]:
        """Return a function that encodes messages of a type; it raises struct.error and the errors of attributes."""

        def write(message: Any) -> bytes:
            out = bytearray()
            self._write_message(name, out, message)
            return bytes(out)

        return write

    def read_into(self, message: Any, data: bytes) -> None:
        """Set the fields of a message from bytes; raises struct.error or ValueError."""
        at = 0
        for slot, read in self._fields_reader(message._type):
            value, at = read(data, at)
            setattr(message, slot, value)

    def _write_message(self, name: str, out: bytearray, message: Any) -> None:
        if (fields := self._writers.get(name)) is None:
            fields = self._writers[name] = [
                (self._slot(field.name), self._field_writer(field)) for field in self._catalogue.message(name).fields
            ]
        for slot, write in fields:
            write(out, getattr(message, slot))

    def _field_writer(self, field: Field) -> Write:
        one = self._single_writer(field.type)
        extent = field.extent
        if extent is None:
            return one
        code = CODES.get(field.type)

        def items(out: bytearray, values: Any) -> None:
            count = len(values)
            if extent < 0:
                out += _LENGTH.pack(count)
            elif count != extent:
                raise struct.error(f"{field.name}: expected {extent} items, got {count}")
            if code == "B" and field.type != "bool" and type(values) not in (list, tuple):
                out += struct.pack(f"<{count}s", values)
            elif code is not None:
                out += struct.pack(f"<{count}{code}", *values)
            else:
                for value in values:
                    one(out, value)

        return items

    def _single_writer(self, kind: str) -> Write:
        if kind in SIZES:
            pack = struct.Struct(f"<{CODES[kind]}").pack
            return lambda out, value: out.extend(pack(value))
        if kind in ("time", "duration"):
            pack = struct.Struct("<II" if kind == "time" else "<ii").pack
            return lambda out, value: out.extend(pack(value.secs, value.nsecs))
        if kind == "string":
            return _write_string
        return lambda out, value: self._write_message(kind, out, value)

    def _fields_reader(self, name: str) -> list[tuple[str, Read]]:
        if (fields := self._readers.get(name)) is None:
            fields = self._readers[name] = [
                (self._slot(field.name), self._field_reader(field)) for field in self._catalogue.message(name).fields
            ]
        return fields

    def _field_reader(self, field: Field) -> Read:
        one = self._single_reader(field.type)
        extent = field.extent
        if extent is None:
            return one
        code, size = CODES.get(field.type), SIZES.get(field.type, ("", 1))[1]

        def items(data: bytes, at: int) -> tuple[Any, int]:
            count = extent
            if count < 0:
                (count,) = _LENGTH.unpack_from(data, at)
                at += 4
            if code is not None:
                end = at + count * size
                if end > len(data):
                    raise struct.error(f"{field.name}: {count} values with {len(data) - at} bytes left")
                if code == "B" and field.type != "bool":
                    return bytes(data[at:end]), end
                found: Any = struct.unpack_from(f"<{count}{code}", data, at)
                return (list(map(bool, found)) if field.type == "bool" else found), end
            found = []
            for _ in range(count):
                if at >= len(data) and field.type != "std_msgs/Empty":
                    raise struct.error(f"{field.name}: {count} values, but the data ends")
                value, at = one(data, at)
                found.append(value)
            return found, at

        return items

    def _single_reader(self, kind: str) -> Read:
        if kind in SIZES:
            layout = struct.Struct(f"<{CODES[kind]}")
            convert: Callable[[Any], Any] = bool if kind == "bool" else lambda value: value
            return lambda data, at: (convert(layout.unpack_from(data, at)[0]), at + layout.size)
        if kind in ("time", "duration"):
            layout = struct.Struct("<II" if kind == "time" else "<ii")
            cls = self._classes.time if kind == "time" else self._classes.duration
            return lambda data, at: (cls(*layout.unpack_from(data, at)), at + 8)
        if kind == "string":
            return _read_string

        def message(data: bytes, at: int) -> tuple[Any, int]:
            made = self._classes.message(kind)()
            for slot, read in self._fields_reader(kind):
                value, at = read(data, at)
                setattr(made, slot, value)
            return made, at

        return message


def _write_string(out: bytearray, value: Any) -> None:
    len(value)
    data = value.encode("utf-8")
    out += _LENGTH.pack(len(data))
    out += data


def _read_string(data: bytes, at: int) -> tuple[str, int]:
    (size,) = _LENGTH.unpack_from(data, at)
    end = at + 4 + size
    if end > len(data):
        raise struct.error(f"a text of {size} bytes with {len(data) - at - 4} left")
    return bytes(data[at + 4 : end]).decode("utf-8", "replace"), end
