"""The classes of ROS 1 messages and services, one per type and process, and the checks of their fields."""

from __future__ import annotations

import keyword
import struct
import sys
from collections.abc import Callable
from typing import Any

from messages.interfaces import Catalogue, Field, MessageDefinition, catalogue
from messages.interfaces.definition import SIZES
from services.script.message_codec import Codec
from services.script.ros1_format import Ros1Format

_SIGNED = {"byte", "int8", "int16", "int32", "int64"}
_FLOATS = {"float32", "float64"}
_NUMPY = ("float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")


class MessageClasses:
    """Creates classes of message types from a base class, and encodes and decodes their messages.

    Args:
        message: The base class.
        time: The class of times.
        duration: The class of durations.
        not_deserializable: The exception for bytes that are not the message.
    """

    def __init__(
        self,
        message: type,
        time: type,
        duration: type,
        not_deserializable: type[Exception],
    ) -> None:
        self.time, self.duration = time, duration
        self._base, self._not_deserializable = message, not_deserializable
        self._checker = TypeChecker(message, time, duration)
        self._codec = Codec(catalogue(), self, slot_name)
        self._format = Ros1Format(catalogue(), self, slot_name)
        self._classes: dict[str, type] = {}
        self._services: dict[str, type] = {}
        self._encoders: dict[type, Callable[[Any], bytes]] = {}
        self._decoders: dict[type, Callable[[bytes], Any]] = {}

    @property
    def catalogue(self) -> Catalogue:
        """The definitions from which the classes are created."""
        return catalogue()

    def message(self, name: str) -> type:
        """Return the class of the message ``pkg/Type``; raises UnknownType or BadDefinition."""
        if (known := self._classes.get(name)) is None:
            closure = catalogue().closure(name)
            known = self._classes[name] = self._message_class(closure[name])
        return known

    def service(self, name: str) -> type:
        """Return the class of the service ``pkg/Type``; raises UnknownType or BadDefinition."""
        if (known := self._services.get(name)) is None:
            definition = catalogue().service(name)
            package, _, own = name.partition("/")
            members = {
                "__module__": f"{package}.srv._{own}",
                "_type": name,
                "_md5sum": catalogue().md5(name),
                "_request_class": self.message(definition.request.name),
                "_response_class": self.message(definition.response.name),
            }
            known = self._services[name] = type(own, (), members)
        return known

    def encode(self, message: Any) -> bytes:
        """Encode a message as MessagePack; raises the errors of ROS 1's serialization."""
        cls = type(message)
        if (write := self._encoders.get(cls)) is None:
            write = self._encoders[cls] = self._codec.encoder(cls._type)
        return self._written(write, message)

    def decode(self, cls: type, payload: bytes) -> Any:
        """Decode a message of a class from MessagePack; raises WrongPayload."""
        if (read := self._decoders.get(cls)) is None:
            read = self._decoders[cls] = self._codec.decoder(cls._type)  # type: ignore[attr-defined]
        return read(payload)

    def fault(self, name: str, kind: str, value: Any) -> str | None:
        """Return why a value does not fit a field's type, in ROS 1's words; None if it fits."""
        return self._checker.fault(name, kind, value)

    def _written(self, write: Callable[[Any], bytes], message: Any) -> bytes:
        try:
            return write(message)
        except (struct.error, TypeError) as error:
            kind = struct.error if isinstance(error, struct.error) else ValueError
            message._check_types(kind(f"{type(error)}: '{error}' when writing '{message}'"))
            raise

    def _message_class(self, definition: MessageDefinition) -> type:
        package, _, own = definition.name.partition("/")
        folder = "srv" if self._is_part_of_service(definition.name) else "msg"
        types = [field.full_type for field in definition.fields]
        slots = [slot_name(field.name) for field in definition.fields]
        members: dict[str, Any] = {
            "__module__": f"{package}.{folder}._{own.removesuffix('Request').removesuffix('Response')}"
            if folder == "srv"
            else f"{package}.msg._{own}",
            "__slots__": slots,
            "_slot_types": types,
            "_type": definition.name,
            "_md5sum": catalogue().md5(definition.name),
            "_full_text": catalogue().full_text(definition.name),
            "_has_header": definition.fields[:1] == (Field("header", "std_msgs/Header"),),
            **{slot_name(constant.name): constant.value for constant in definition.constants},
            "__init__": self._constructor(definition, slots),
            "_get_types": lambda message: types,
            "serialize": lambda message, buff: self._serialize(message, buff),
            "deserialize": lambda message, data: self._deserialize(message, data),
            "serialize_numpy": lambda message, buff, numpy: self._serialize(message, buff),
            "deserialize_numpy": lambda message, data, numpy: self._deserialize_numpy(message, data, numpy),
        }
        return type(own, (self._base,), members)

    def _is_part_of_service(self, name: str) -> bool:
        package, _, own = name.partition("/")
        if own in catalogue().types(package, "msg"):
            return False
        services = catalogue().types(package, "srv")
        return own.removesuffix("Request") in services or own.removesuffix("Response") in services

    def _constructor(self, definition: MessageDefinition, slots: list[str]) -> Any:
        """Return ``__init__``, compiled, since scripts create many messages."""
        names: dict[str, Any] = {"base": self._base, "Time": self.time, "Duration": self.duration}
        given, empty = [], []
        for index, (field, slot) in enumerate(zip(definition.fields, slots, strict=True)):
            default = self._default(field.type, field.extent, f"n{index}", names)
            given.append(f"        if self.{slot} is None:\n            self.{slot} = {default}")
            empty.append(f"        self.{slot} = {default}")
        lines = [
            "def __init__(self, *args, **kwds):",
            "    if args or kwds:",
            "        base.__init__(self, *args, **kwds)",
            *given,
            "    else:",
            *(empty or ["        pass"]),
        ]
        exec("\n".join(lines), names)
        return names["__init__"]

    def _default(self, kind: str, extent: int | None, name: str, names: dict[str, Any]) -> str:
        """Return the expression for the default of a field."""
        if extent is not None and kind in ("uint8", "char"):
            return "b''" if extent < 0 else f"b'\\0' * {extent}"
        if extent == -1:
            return "[]"
        if kind in SIZES or kind == "string":
            single = (
                "False" if kind == "bool" else "0.0" if kind.startswith("float") else "''" if kind == "string" else "0"
            )
            return single if extent is None else f"[{single}] * {extent}"
        if kind in ("time", "duration"):
            single = f"{kind.capitalize()}()"
        else:
            names[name] = self.message(kind)
            single = f"{name}()"
        return single if extent is None else f"[{single} for _ in range({extent})]"

    def _serialize(self, message: Any, buff: Any) -> None:
        buff.write(self._written(self._format.writer(message._type), message))

    def _deserialize(self, message: Any, data: bytes) -> Any:
        try:
            self._format.read_into(message, data)
        except (struct.error, ValueError) as error:
            raise self._not_deserializable(error) from None
        return message

    def _deserialize_numpy(self, message: Any, data: bytes, numpy: Any) -> Any:
        self._deserialize(message, data)
        for slot, kind in zip(message.__slots__, message._slot_types, strict=True):
            base, mark, _ = kind.partition("[")
            if mark and base in SIZES:
                dtype = {"bool": "bool", "byte": "int8", "char": "uint8"}.get(base, base)
                value = getattr(message, slot)
                made = numpy.frombuffer(value, dtype) if isinstance(value, bytes) else numpy.array(value, dtype)
                setattr(message, slot, made)
        return message


def slot_name(name: str) -> str:
    """Return the attribute of a field: Python keywords get an underscore."""
    return f"{name}_" if keyword.iskeyword(name) or name == "self" else name


class TypeChecker:
    """Checks values against field types.

    Args:
        message: The base class of messages.
        time: The class of times.
        duration: The class of durations.
    """

    def __init__(self, message: type, time: type, duration: type) -> None:
        self._message = message
        self._times = {"time": ("Time", time), "duration": ("Duration", duration)}

    def fault(self, name: str, kind: str, value: Any) -> str | None:
        """Return why ``value`` does not fit the field ``name`` of the type ``kind``; None if it does."""
        if kind in SIZES:
            return _number_fault(name, kind, value)
        if kind == "string":
            if isinstance(value, str):
                return None if value.isascii() else f"field {name} is a non-ascii string"
            return None if type(value) is bytes else f"field {name} must be of type bytes or an ascii string"
        if kind in self._times:
            word, expected = self._times[kind]
            return None if isinstance(value, expected) else f"field {name} must be of type {word}"
        if kind.endswith("]"):
            return self._items_fault(name, kind.partition("[")[0], value)
        return self._message_fault(name, kind, value)

    def _items_fault(self, name: str, kind: str, value: Any) -> str | None:
        if type(value) in (bytes, str):
            if kind in ("char", "uint8"):
                return None
            return f"field {name} must be a list or tuple type. Only uint8[] can be a string"
        if type(value) not in (list, tuple):
            return f"field {name} must be a list or tuple type"
        return next((fault for each in value if (fault := self.fault(f"{name}[]", kind, each))), None)

    def _message_fault(self, name: str, kind: str, value: Any) -> str | None:
        if not isinstance(value, self._message):
            return f"field {name} must be of type [{kind}]"
        own = getattr(value, "_type", "")
        if own != kind:
            if own == "std_msgs/Header":
                return f"field {name} must be a Header instead of a {own}"
            return f"field {name} must be of type {kind} instead of {own}"
        slots: list[str] = getattr(value, "__slots__", [])
        types: list[str] = getattr(value, "_slot_types", [])
        for slot, each in zip(slots, types, strict=True):
            if fault := self.fault(f"{name}.{slot}", each, getattr(value, slot)):
                return fault
        return None


def _number_fault(name: str, kind: str, value: Any) -> str | None:
    if kind in _FLOATS:
        return None if type(value) in (int, float) or _of_numpy(value) else f"field {name} must be float type"
    if kind == "bool":
        return None if value in (True, False, 0, 1) else f"field {name} is not a bool"
    bits = 8 * SIZES[kind][1]
    if kind in _SIGNED:
        if type(value) is not int:
            return f"field {name} must be an integer type"
        fits = -(1 << bits - 1) <= value < 1 << bits - 1
    else:
        if type(value) is not int or value < 0:
            return f"field {name} must be unsigned integer type"
        fits = value < 1 << bits
    return None if fits else f"field {name} exceeds specified width [{kind}]"


def _of_numpy(value: Any) -> bool:
    numpy = sys.modules.get("numpy")
    return numpy is not None and type(value) in [getattr(numpy, name) for name in _NUMPY]
