"""Definitions of message types, read from ROS 2's text and written as such."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

SIZES = {
    "bool": ("?", 1),
    "byte": ("B", 1),
    "char": ("B", 1),
    "uint8": ("B", 1),
    "int8": ("b", 1),
    "uint16": ("H", 2),
    "int16": ("h", 2),
    "uint32": ("I", 4),
    "int32": ("i", 4),
    "uint64": ("Q", 8),
    "int64": ("q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
"""Code of ``struct`` and bytes of every number."""

DEEPEST = 16
"""Levels of types within types; ROS has five at most."""
LARGEST_LEAST = 1 << 26
"""Bytes that the smallest message of a type may have: its reader makes a value of each of its fields."""

SEPARATOR = "=" * 80

_ALIASES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration", "Header": "std_msgs/Header"}
_TIME = "int32 sec\nuint32 nanosec"
_FIELD = re.compile(r"([A-Za-z][\w/]*)(<=\d+)?(?:\[(<=)?(\d{0,12})\])?\s+([A-Za-z]\w*)(?:\s+(?!=).*)?")
_CONSTANT = re.compile(r"[A-Za-z][\w/<=]*\s+\w+\s*=.*")


class Field(NamedTuple):
    """A field: ``extent`` is None for a single value, -1 for a sequence, else the length of an array.

    ``bound`` is the greatest length of a sequence, 0 without one.
    """

    name: str
    type: str
    extent: int | None = None
    bound: int = 0

    def __str__(self) -> str:
        match self.extent:
            case None:
                return f"{self.type} {self.name}"
            case -1:
                return f"{self.type}[{f'<={self.bound}' if self.bound else ''}] {self.name}"
            case length:
                return f"{self.type}[{length}] {self.name}"


Definitions = Mapping[str, tuple[Field, ...]]
"""Types by name (``geometry_msgs/Pose``), each with its fields in order."""


class BadDefinition(ValueError):
    """A text does not define a message type; it says where."""


def parse(name: str, text: str) -> Definitions:
    """The type ``name`` and those that it is made of, from a text as it stands in MCAP files; raises BadDefinition.

    The definitions of other types follow behind lines of ``=``, each under ``MSG: package/Type``.
    """
    found: dict[str, tuple[Field, ...]] = {}
    for number, section in enumerate(re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)):
        lines = section.strip("\n").splitlines()
        own = short(name)
        if number:
            head = lines.pop(0) if lines else ""
            if not head.startswith("MSG:"):
                raise BadDefinition(f"{name}: expected 'MSG: package/Type' after a separator, got {head[:80]!r}")
            own = short(head.removeprefix("MSG:").strip())
        found[own] = fields_in(own, lines)
    for time in ("builtin_interfaces/Time", "builtin_interfaces/Duration"):
        found.setdefault(time, fields_in(time, _TIME.splitlines()))
    _check(short(name), found, (), {})
    return found


def fields_in(owner: str, lines: Iterable[str]) -> tuple[Field, ...]:
    """The fields that the lines of the type ``owner`` state; raises BadDefinition."""
    return tuple(_fields(owner, lines))


def short(name: str) -> str:
    """``geometry_msgs/Pose`` for ``geometry_msgs/msg/Pose``."""
    return name.replace("/msg/", "/", 1)


def long(name: str) -> str:
    """``geometry_msgs/msg/Pose`` for ``geometry_msgs/Pose``; what says its kind, as ``pkg/srv/X_Request``, stays."""
    package, slash, own = name.partition("/")
    return f"{package}/msg/{own}" if slash and "/" not in own else name


def least(name: str, definitions: Definitions) -> int:
    """Bytes of the smallest value of a type, without alignment; one at least."""
    if name in SIZES:
        return SIZES[name][1]
    return 4 if name == "string" else _least(name, definitions, {})


def text_of(name: str, definitions: Definitions) -> str:
    """The text of a type and of those that it is made of, as ``parse`` reads it."""
    parts = []
    for each in closure(name, definitions):
        head = "" if each == name else f"MSG: {each}\n"
        parts.append(head + "".join(f"{field}\n" for field in definitions[each]))
    return f"{SEPARATOR}\n".join(parts)


def closure(name: str, definitions: Definitions) -> list[str]:
    """A type and all that it is made of, itself first, in the order in which they are met."""
    met = [name]
    for each in met:
        met += [kind for kind in dict.fromkeys(f.type for f in definitions[each]) if _complex(kind) and kind not in met]
    return met


def _complex(kind: str) -> bool:
    return kind not in SIZES and kind != "string"


def _fields(owner: str, lines: Iterable[str]) -> Iterator[Field]:
    package = owner.partition("/")[0]
    for line in lines:
        bare = line.partition("#")[0].strip()
        if not bare or _CONSTANT.fullmatch(bare):
            continue
        found = _FIELD.fullmatch(bare)
        if found is None:
            raise BadDefinition(f"{owner}: {line.strip()[:80]!r} is not a field")
        kind, _, bounded, length, name = found.groups()
        kind = _ALIASES.get(kind, short(kind))
        if _complex(kind) and "/" not in kind:
            kind = f"{package}/{kind}"
        count = None if length is None else -1 if bounded or not length else int(length)
        yield Field(name, kind, count, int(length) if bounded and length else 0)


def _check(name: str, definitions: Definitions, above: tuple[str, ...], depths: dict[str, int]) -> int:
    """The levels of a type, which is checked once, however often it is used; raises BadDefinition."""
    if name in above or len(above) + depths.get(name, 0) > DEEPEST:
        raise BadDefinition(f"{name} holds itself, or types lie more than {DEEPEST} deep")
    if name in depths:
        return depths[name]
    if name not in definitions:
        raise BadDefinition(f"{above[-1] if above else name}: {name} is not defined")
    below = [0]
    for field in definitions[name]:
        if field.extent == 0:
            raise BadDefinition(f"{name}: '{field}' is an array of length 0")
        if _complex(field.type):
            below.append(1 + _check(field.type, definitions, (*above, name), depths))
    depths[name] = max(below)
    if not above and (size := _least(name, definitions, {})) > LARGEST_LEAST:
        raise BadDefinition(f"the smallest {name} has {size} bytes, the limit is {LARGEST_LEAST}")
    return depths[name]


def _least(name: str, definitions: Definitions, known: dict[str, int]) -> int:
    if name in known:
        return known[name]
    total = 0
    for field in definitions[name]:
        if field.extent == -1:
            total += 4
            continue
        one = _least(field.type, definitions, known) if _complex(field.type) else SIZES.get(field.type, ("", 4))[1]
        total += one * (1 if field.extent is None else field.extent)
    known[name] = max(1, total)
    return known[name]
