"""The fields of a message by their paths: ``pose.pose.position.x``, ``ranges[90]``, ``pose.pose.orientation.yaw``."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from functools import cache
from typing import Any

import msgspec

from messages.base import Array, Message, WrongPayload
from messages.geometry import Quaternion
from messages.rosgraph import Clock
from messages.std import Header
from messages.tf import TFMessage
from services.runtime.errors import BadInput

MOST = 600
"""Leaves of a message that are listed."""
MOST_OF_ARRAY = 64
"""Elements of a list that are listed; a path reaches all of them."""
DEEPEST = 16

Step = str | int
_PATH = re.compile(r"[A-Za-z]\w*(?:\[\d{1,7}\])*(?:\.[A-Za-z]\w*(?:\[\d{1,7}\])*)*", re.ASCII)
_STEP = re.compile(r"[A-Za-z]\w*|\d+", re.ASCII)

Leaf = bool | int | float | str | None


def parse(path: str) -> tuple[Step, ...]:
    """The steps of a path; raises BadInput."""
    if not _PATH.fullmatch(path):
        raise BadInput(f"{path[:80]!r} is no path of a field; write it as pose.pose.position.x or ranges[0]")
    steps = tuple(int(each) if each[0].isdigit() else each for each in _STEP.findall(path))
    if len(steps) > DEEPEST:
        raise BadInput(f"{path[:80]!r} has {len(steps)} steps, the limit is {DEEPEST}")
    return steps


def number(message: Any, steps: tuple[Step, ...]) -> float | None:
    """The number at the end of a path, bool as 0 or 1; None when there is none, or it is not finite."""
    value = message
    for step in steps:
        value = descend(value, step)
        if value is None:
            return None
    if type(value) is float:
        return value if math.isfinite(value) else None
    return float(value) if isinstance(value, int) and abs(value) < 2**1000 else None


def descend(value: Any, step: Step) -> Any:
    """The field or element that a step leads to; None when there is none."""
    if isinstance(step, int):
        if isinstance(value, Array):
            size = int(value.DTYPE[-1])
            inside = (step + 1) * size <= len(value.raw)
            return struct.unpack_from(_FORMATS[value.DTYPE], value.raw, step * size)[0] if inside else None
        return value[step] if isinstance(value, tuple | list) and step < len(value) else None
    if isinstance(value, dict):
        return value.get(step)
    if not isinstance(value, Message) or step not in _names(type(value)):
        return None
    try:
        return getattr(value, step)
    except WrongPayload:
        return None


def leaves(message: Any) -> list[tuple[str, Leaf]]:
    """Paths and values of what a message holds, MOST of them at most."""
    found: list[tuple[str, Leaf]] = []
    for leaf in _walk(message, "", 0):
        found.append(leaf)
        if len(found) >= MOST:
            break
    return found


def stamp(message: Any) -> int | None:
    """The simulation time [ns] that a message tells, None when it tells none."""
    if isinstance(message, TFMessage):
        message = message.transforms[0] if message.transforms else None
    if isinstance(message, Clock):
        return message.clock.ns
    header = getattr(message, "header", None)
    if isinstance(header, Header):
        return header.stamp.ns or None
    return None


def _walk(value: Any, path: str, depth: int) -> Iterator[tuple[str, Leaf]]:
    if depth > DEEPEST:
        return
    if isinstance(value, Message):
        for name in _names(type(value)):
            yield from _walk(descend(value, name), f"{path}.{name}" if path else name, depth + 1)
    elif isinstance(value, dict):
        for name, each in value.items():
            if isinstance(name, str) and _PATH.fullmatch(name):
                yield from _walk(each, f"{path}.{name}" if path else name, depth + 1)
    elif isinstance(value, Array | tuple | list):
        length = len(value.raw) // int(value.DTYPE[-1]) if isinstance(value, Array) else len(value)
        for index in range(min(MOST_OF_ARRAY, length)):
            yield from _walk(descend(value, index), f"{path}[{index}]", depth + 1)
    elif isinstance(value, bool | int | float | str) or value is None:
        yield path, value[:200] if isinstance(value, str) else _shown(value)


def _shown(value: bool | int | float | None) -> Leaf:
    """As JSON can carry it."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


@cache
def _names(record: type[Message]) -> tuple[str, ...]:
    """The fields of a record as they are called on the wire; a rotation has its heading beside them."""
    names = tuple(each.encode_name for each in msgspec.structs.fields(record))
    return (*names, "yaw") if record is Quaternion else names


_FORMATS = {"<f8": "<d", "<f4": "<f"}
