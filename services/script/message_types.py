"""What is wrong with a message's field, in the words of ROS 1."""

from __future__ import annotations

import sys
from typing import Any

from messages.interfaces.definition import SIZES

_SIGNED = {"byte", "int8", "int16", "int32", "int64"}
_FLOATS = {"float32", "float64"}
_NUMPY = ("float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")


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
        """Why ``value`` does not fit the field ``name`` of the type ``kind``; None if it does."""
        if kind in SIZES:
            return _number_fault(name, kind, value)
        if kind == "string":
            if isinstance(value, str):
                return None if value.isascii() else f"field {name} is a non-ascii string"
            return None if type(value) is bytes else f"field {name} must be of type bytes or an ascii string"
        if kind in self._times:
            word, wanted = self._times[kind]
            return None if isinstance(value, wanted) else f"field {name} must be of type {word}"
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
