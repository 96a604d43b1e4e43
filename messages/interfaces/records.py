"""Record classes for types that have none in this project, generated from standard definitions or from other nodes'.

With such a record, a message of any type can be decoded, displayed, built from text and written as CDR like our own.
"""

from __future__ import annotations

import keyword
import re
from functools import lru_cache
from types import GenericAlias
from typing import Annotated, Any, ClassVar

import msgspec
from msgspec import Meta

from messages.base import Float32Array, Float64Array, Message
from messages.cdr.definitions import minimum_size, parse, text_of
from messages.errors import BadInput, nearest
from messages.interfaces.catalogue import UnknownType, catalogue, standard_catalogue
from messages.interfaces.definition import SIZES, BadDefinition, Definitions, Field, short_type_name
from messages.records import RECORDS, UnknownRecord

MOST_LEARNED = 1000
"""Maximum number of types learned from other processes."""
LARGEST_DEFAULT = 1 << 20
"""Maximum size [bytes] of the smallest message of a type, since its record holds one as its defaults."""
LONGEST_TEXT = 1 << 16
"""Maximum size of a definition from another process [bytes]."""

_TYPE = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)
_RESERVED = frozenset(["self", "ROS_TYPE", "DEFINITIONS"])
_learned: dict[str, tuple[str, type[Message]]] = {}


class GeneratedMessage(Message, frozen=True, kw_only=True):
    """Base class of records generated from a definition."""

    DEFINITIONS: ClassVar[Definitions] = {}


def find_record(name: str) -> type[Message] | None:
    """Return the record of a ROS type: our own, a learned one, or one of the catalogue; None if it is unknown."""
    name = short_type_name(name)
    if (known := RECORDS.get(name)) is not None:
        return known
    if name in _learned:
        return _learned[name][1]
    try:
        return _catalogue_record(name, tuple(catalogue().definitions(name).items()))
    except (UnknownType, BadDefinition):
        return None


def need_record(name: str) -> type[Message]:
    """Return the record of a ROS type; raises UnknownRecord with similar names."""
    if (found := find_record(name)) is not None:
        return found
    short: dict[str, list[str]] = {}
    known = list(dict.fromkeys([*RECORDS, *_learned, *catalogue().all_types("msg")]))
    for each in known:
        short.setdefault(each.rpartition("/")[2], []).append(each)
    near = short.get(name.rpartition("/")[2], [])[:3] or nearest(name, known, 3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    raise UnknownRecord(f"unknown record {name[:80]!r}{hint}")


def definition_text(name: str) -> str:
    """Return the ``ros2msg`` definition of a type that other processes cannot know, with all types that it uses; empty
    for all other types."""
    name = short_type_name(name)
    if name in RECORDS or _is_standard(name):
        return ""
    try:
        text = text_of(name, catalogue().definitions(name))
    except (UnknownType, BadDefinition):
        return ""
    return text if len(text) <= LONGEST_TEXT else ""


def learn(name: str, text: str) -> bool:
    """Add a type by its ``ros2msg`` definition from another process; return False if it is already known.

    Raises BadInput if the definition cannot be parsed, is too large, or contradicts an earlier one.
    """
    name = short_type_name(name)
    if not _TYPE.fullmatch(name):
        raise BadInput(f"{name[:80]!r} is not the name of a type, e.g. my_pkg/Step")
    if len(text) > LONGEST_TEXT:
        raise BadInput(f"the definition of {name[:80]!r} has {len(text)} bytes, the limit is {LONGEST_TEXT}")
    if name in _learned:
        if _learned[name][0] != text:
            raise BadInput(f"{name[:80]} is defined in two ways: the first definition is kept")
        return False
    if name in RECORDS or _is_standard(name):
        return False
    if len(_learned) >= MOST_LEARNED:
        raise BadInput(f"{name[:80]} is one type too many: {MOST_LEARNED} are known from other processes")
    _learned[name] = text, generate_record(name, parse(name, text))
    return True


def forget_learned() -> None:
    """Forget all types learned from other processes; for tests."""
    _learned.clear()


def generate_record(name: str, types: Definitions) -> type[Message]:
    """Generate a record for the type ``name``; raises BadDefinition if its smallest message is too large."""
    if (size := minimum_size(name, types)) > LARGEST_DEFAULT:
        raise BadDefinition(f"the smallest {name} has {size} bytes, the limit for a record is {LARGEST_DEFAULT}")
    return _Generator(types).record(name)


class _Generator:
    """Generates the records of one set of definitions; for nested types, our own records are used if there are any."""

    def __init__(self, types: Definitions) -> None:
        self._types = types
        self._made: dict[str, type[Message]] = {}

    def record(self, name: str) -> type[Message]:
        made = self._made.get(name)
        if made is None:
            own = {_attribute(field.name): field for field in self._types[name]}
            generated: Any = msgspec.defstruct(
                name.rpartition("/")[2],
                [(attribute, *self._field(field)) for attribute, field in own.items()],
                bases=(GeneratedMessage,),
                namespace={"ROS_TYPE": name, "DEFINITIONS": self._types, "__doc__": ""},
                rename={attribute: field.name for attribute, field in own.items()},
                frozen=True,
                kw_only=True,
                gc=False,
            )
            made = self._made[name] = generated
        return made

    def _field(self, field: Field) -> tuple[Any, Any]:
        """Return the type of a field and its default."""
        if field.extent is None:
            return self._single(field.type)
        fixed = field.extent if field.extent > 0 else 0
        most = fixed or field.bound or None
        bounds = Meta(min_length=fixed or None, max_length=most)
        if field.type in ("uint8", "char"):
            return (Annotated[bytes, bounds] if most else bytes), bytes(fixed)
        if not most and field.type in ("float32", "float64"):
            array = Float32Array if field.type == "float32" else Float64Array
            return array, array()
        one, default = self._single(field.type)
        many: Any = GenericAlias(tuple, (one, ...))
        return (Annotated[many, bounds] if most else many), (default,) * fixed

    def _single(self, kind: str) -> tuple[Any, Any]:
        if kind == "string":
            return str, ""
        if kind in SIZES:
            return _number(kind), False if kind == "bool" else 0.0 if kind.startswith("float") else 0
        record = RECORDS.get(kind) or self.record(kind)
        return record, record()


def _is_standard(name: str) -> bool:
    try:
        standard_catalogue().message(name)
    except UnknownType:
        return False
    return True


@lru_cache(maxsize=2000)
def _catalogue_record(name: str, types: tuple[tuple[str, tuple[Field, ...]], ...]) -> type[Message]:
    return generate_record(name, dict(types))


def _number(kind: str) -> Any:
    if kind == "bool" or kind.startswith("float"):
        return bool if kind == "bool" else float
    bits = 8 * SIZES[kind][1]
    signed = kind.startswith("int")
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    return Annotated[int, Meta(ge=low, le=high) if high < 1 << 63 else Meta(ge=0)]


def _attribute(name: str) -> str:
    return f"{name}_" if keyword.iskeyword(name) or name in _RESERVED else name
