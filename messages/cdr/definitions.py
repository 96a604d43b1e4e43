"""Definitions of ROS 2 message types: parsed from the schemas of a bag, written as text, derived from records.

A record of a standard type has ROS 2's own definition (``messages/interfaces``); a test compares the hash of each with
that of an independent library. ``rosbags`` could parse the text, but it has no limits for hostile definitions, takes
1.6 ms for an Odometry where ``parse`` takes 0.08, and needs four more packages.
"""

from __future__ import annotations

import re
from functools import cache

import msgspec.inspect as kinds

from messages.base import Array, Float32Array, Message
from messages.interfaces.catalogue import DEEPEST, SEPARATOR, UnknownType, standard_catalogue
from messages.interfaces.definition import (
    SIZES,
    BadDefinition,
    Definitions,
    Field,
    parse_lines,
    ros2_form,
    short_type_name,
)

LARGEST_LEAST = 1 << 26
"""Maximum size [bytes] of the smallest message of a type, since decoding creates a value for each field."""

_TIME = "int32 sec\nuint32 nanosec"


def parse(name: str, text: str) -> Definitions:
    """Parse the type ``name`` and all types that it uses from the text of an MCAP schema; raises BadDefinition.

    The definitions of the other types follow lines of ``=``, each under ``MSG: package/Type``.
    """
    found: dict[str, tuple[Field, ...]] = {}
    for number, section in enumerate(re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)):
        lines = section.strip("\n").splitlines()
        own = short_type_name(name)
        if number:
            head = lines.pop(0) if lines else ""
            if not head.startswith("MSG:"):
                raise BadDefinition(f"{name}: expected 'MSG: package/Type' after a separator, got {head[:80]!r}")
            own = short_type_name(head.removeprefix("MSG:").strip())
        found[own] = fields_in(own, lines)
    for time in ("builtin_interfaces/Time", "builtin_interfaces/Duration"):
        found.setdefault(time, fields_in(time, _TIME.splitlines()))
    _check(short_type_name(name), found, (), {})
    return found


def fields_in(owner: str, lines: list[str]) -> tuple[Field, ...]:
    """Parse the lines of the type ``owner`` to its fields in ROS 2's form; raises BadDefinition."""
    return ros2_form(parse_lines(owner, enumerate(lines, 1), owner)).fields


def long_type_name(name: str) -> str:
    """Return ``geometry_msgs/msg/Pose`` for ``geometry_msgs/Pose``; names like ``pkg/srv/X_Request`` are unchanged."""
    package, slash, own = name.partition("/")
    return f"{package}/msg/{own}" if slash and "/" not in own else name


def minimum_size(name: str, definitions: Definitions) -> int:
    """Return the size [bytes] of the smallest value of a type without alignment, at least 1."""
    if name in SIZES:
        return SIZES[name][1]
    return 4 if name == "string" else _minimum_size(name, definitions, {})


def text_of(name: str, definitions: Definitions) -> str:
    """Return the text of a type and all types that it uses, in the format of ``parse``."""
    parts = []
    for each in closure(name, definitions):
        head = "" if each == name else f"MSG: {each}\n"
        parts.append(head + "".join(f"{field}\n" for field in definitions[each]))
    return f"{SEPARATOR}\n".join(parts)


def closure(name: str, definitions: Definitions) -> list[str]:
    """List a type and all types that it uses, in order of first use."""
    met = [name]
    for each in met:
        met += [kind for kind in dict.fromkeys(f.type for f in definitions[each]) if _complex(kind) and kind not in met]
    return met


def _complex(kind: str) -> bool:
    return kind not in SIZES and kind != "string"


def _check(name: str, definitions: Definitions, above: tuple[str, ...], depths: dict[str, int]) -> int:
    """Check a type, once however often it is used, and return its number of nested levels; raises BadDefinition."""
    if name in above or len(above) + depths.get(name, 0) > DEEPEST:
        raise BadDefinition(f"{name} contains itself, or types are nested more than {DEEPEST} levels deep")
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
    if not above and (size := _minimum_size(name, definitions, {})) > LARGEST_LEAST:
        raise BadDefinition(f"the smallest {name} has {size} bytes, the limit is {LARGEST_LEAST}")
    return depths[name]


def _minimum_size(name: str, definitions: Definitions, known: dict[str, int]) -> int:
    if name in known:
        return known[name]
    total = 0
    for field in definitions[name]:
        if field.extent == -1:
            total += 4
            continue
        one = (
            _minimum_size(field.type, definitions, known) if _complex(field.type) else SIZES.get(field.type, ("", 4))[1]
        )
        total += one * (1 if field.extent is None else field.extent)
    known[name] = max(1, total)
    return known[name]


_WIDTHS = (("uint8", 0, 2**8 - 1), ("uint32", 0, 2**32 - 1), ("int32", -(2**31), 2**31 - 1))


@cache
def definitions(record: type[Message]) -> Definitions:
    """Return the type of a record and all types that it uses, by name."""
    own: Definitions | None = getattr(record, "DEFINITIONS", None)
    if own is not None:  # the record was generated from these definitions
        return {name: own[name] for name in closure(record.ROS_TYPE, own)}
    found: dict[str, tuple[Field, ...]] = {}
    _derive(record, found)
    return {name: found[name] for name in closure(record.ROS_TYPE, found)}


@cache
def fields_of(record: type[Message]) -> dict[str, kinds.Field]:
    """Return the fields of a record by their names on the wire."""
    info = kinds.type_info(record)
    assert isinstance(info, kinds.StructType)
    return {field.encode_name: field for field in info.fields}


def unwrap(kind: kinds.Type) -> kinds.Type:
    """Return a field's type without its metadata (unit, description)."""
    return unwrap(kind.type) if isinstance(kind, kinds.Metadata) else kind


def nested_record(kind: kinds.Type) -> type[Message] | None:
    """Return the record class of a field that holds a record, else None."""
    return kind.cls if isinstance(kind, kinds.StructType) and issubclass(kind.cls, Message) else None


def optional(kind: kinds.Type) -> kinds.Type | None:
    """Return ``X`` for ``X | None``, None for every other type."""
    if isinstance(kind, kinds.UnionType) and len(kind.types) == 2:
        rest = [each for each in kind.types if not isinstance(each, kinds.NoneType)]
        return unwrap(rest[0]) if len(rest) == 1 else None
    return None


def anything(kind: kinds.Type) -> bool:
    """Whether a field holds a parameter's value, whose type is known only at run time."""
    return isinstance(kind, kinds.UnionType) and optional(kind) is None and not packed(kind)


def packed(kind: kinds.Type) -> bool:
    """Whether a field is a ``Packed36``."""
    return isinstance(kind, kinds.UnionType) and any(isinstance(each, kinds.ExtType) for each in kind.types)


def _derive(record: type[Message], found: dict[str, tuple[Field, ...]]) -> None:
    if record.ROS_TYPE in found:
        return
    try:
        found.update(standard_catalogue().definitions(record.ROS_TYPE))
    except UnknownType:
        _derive_fields(record, found)


def _derive_fields(record: type[Message], found: dict[str, tuple[Field, ...]]) -> None:
    found[record.ROS_TYPE] = tuple(_field(name, unwrap(each.type), found) for name, each in fields_of(record).items())


def _field(name: str, kind: kinds.Type, found: dict[str, tuple[Field, ...]]) -> Field:
    if (inner := optional(kind)) is not None:
        return Field(name, _single(inner, found), -1, 1)
    match kind:
        case kinds.VarTupleType(item_type=item, min_length=low, max_length=high):
            return Field(name, _single(unwrap(item), found), low if low is not None and low == high else -1)
        case kinds.CustomType(cls=cls) if issubclass(cls, Array):
            return Field(name, "float32" if issubclass(cls, Float32Array) else "float64", -1)
        case kinds.BytesType():
            return Field(name, "uint8", -1)
    if packed(kind):
        return Field(name, "float64", 36)
    return Field(name, _single(kind, found))


def _single(kind: kinds.Type, found: dict[str, tuple[Field, ...]]) -> str:
    if (nested := nested_record(kind)) is not None:
        _derive(nested, found)
        return nested.ROS_TYPE
    match kind:
        case kinds.BoolType():
            return "bool"
        case kinds.IntType(ge=low, le=high):
            return next((name for name, least, most in _WIDTHS if _within(low, high, least, most)), "int64")
        case kinds.FloatType():
            return "float64"
        case kinds.StrType() | kinds.LiteralType():
            return "string"
    if anything(kind):
        return "string"
    raise TypeError(f"no ROS type for a field of {kind}")


def _within(low: int | None, high: int | None, least: int, most: int) -> bool:
    return low is not None and high is not None and least <= low and high <= most
