"""The classes of ROS 1's messages and services, one for each type of the process."""

from __future__ import annotations

import keyword
import struct
from collections.abc import Callable
from typing import Any

from messages.interfaces import Catalogue, Field, MessageDefinition, catalogue
from messages.interfaces.definition import SIZES
from services.script.message_codec import Codec
from services.script.message_types import TypeChecker
from services.script.ros1_format import Ros1Format


class MessageClasses:
    """Makes classes of message types below a base class, and reads and writes their messages.

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
        """The definitions that the classes are made of."""
        return catalogue()

    def message(self, name: str) -> type:
        """The class of the message ``pkg/Type``; raises UnknownType or BadDefinition."""
        if (known := self._classes.get(name)) is None:
            closure = catalogue().closure(name)
            known = self._classes[name] = self._message_class(closure[name])
        return known

    def service(self, name: str) -> type:
        """The class of the service ``pkg/Type``; raises UnknownType or BadDefinition."""
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
        """A message as MessagePack; raises what ROS 1's serialization raises."""
        cls = type(message)
        if (write := self._encoders.get(cls)) is None:
            write = self._encoders[cls] = self._codec.encoder(cls._type)
        return self._written(write, message)

    def decode(self, cls: type, payload: bytes) -> Any:
        """A message of a class from MessagePack; raises WrongPayload."""
        if (read := self._decoders.get(cls)) is None:
            read = self._decoders[cls] = self._codec.decoder(cls._type)  # type: ignore[attr-defined]
        return read(payload)

    def fault(self, name: str, kind: str, value: Any) -> str | None:
        """Why a value does not fit a field's type, in ROS 1's words."""
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
        """``__init__``, compiled, since scripts make many messages."""
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
        """The expression for the value of a field that was not given."""
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
    """The attribute of a field: words of Python's own get an underscore."""
    return f"{name}_" if keyword.iskeyword(name) or name == "self" else name
