"""The schema of a parameter record: fields with types and bounds, nested tables as dotted names, and constraints."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Protocol, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

from messages.parameters import ParameterDescription

ALL_LEVELS = 2**32 - 1
"""All levels, as of a set's first values."""
MAX_TEXT_LENGTH = 60_000
"""Maximum characters of a JSON text; a longer one is truncated, since it is only displayed."""


class Field(NamedTuple):
    """One value of a record: its dotted name, its type as declared and unwrapped, its annotations, and its default.

    ``structured`` marks lists of tables, which are sent as JSON texts.
    """

    name: str
    hint: Any
    kind: Any
    metas: tuple[Meta, ...]
    optional: bool
    structured: bool
    default: Any

    def extra(self, key: str, default: Any) -> Any:
        """Return an entry of ``Meta(extra=...)``; that of the outermost annotation counts."""
        for meta in reversed(self.metas):
            if meta.extra is not None and key in meta.extra:
                return meta.extra[key]
        return default


class Constraint(NamedTuple):
    """A constraint between a parameter and others of its record, by dotted names; see ``ParameterDescription``."""

    name: str
    at_most: str
    excludes: tuple[str, ...]


class Unwrapped(NamedTuple):
    """The parts of a type hint; ``metas`` from the innermost to the outermost."""

    kind: Any
    metas: tuple[Meta, ...]
    optional: bool


def unwrap(hint: Any) -> Unwrapped:
    """Return the type inside annotations and ``| None``."""
    metas: tuple[Meta, ...] = ()
    optional = False
    while True:
        origin = get_origin(hint)
        if origin is Annotated:
            hint, *notes = get_args(hint)
            metas = (*(each for each in notes if isinstance(each, Meta)), *metas)
        elif origin in (Union, UnionType):
            (hint,) = (each for each in get_args(hint) if each is not NoneType)
            optional = True
        else:
            return Unwrapped(hint, metas, optional)


def element_type(kind: Any) -> Unwrapped | None:
    """Return the element type of a list or tuple; None for any other type."""
    if get_origin(kind) not in (tuple, list):
        return None
    return unwrap(get_args(kind)[0])


@cache
def fields_of(record: type[msgspec.Struct]) -> tuple[Field, ...]:
    """Return the single values of a record, in the order of declaration."""
    return tuple(_fields_of(record, "", (), False))


@cache
def constraints_of(record: type[msgspec.Struct]) -> tuple[Constraint, ...]:
    """Return the constraints in a record's annotations, which refer to parameters of their own table."""
    return tuple(
        Constraint(leaf.name, _sibling(leaf, most) if most else "", tuple(_sibling(leaf, each) for each in excluded))
        for leaf in fields_of(record)
        for most, excluded in [(leaf.extra("at_most", ""), leaf.extra("excludes", ()))]
        if most or excluded
    )


def lengths(leaf: Field) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the minimum and maximum lengths of each list level, outermost first, then of a text; 0 means unbounded."""
    if leaf.structured:
        return (), ()
    found, inner = [], Unwrapped(leaf.kind, leaf.metas, False)
    while True:
        found.append(_length(*inner[:2]))
        if (next_ := element_type(inner.kind)) is None:
            break
        inner = next_
    while found and found[-1] == (0, 0):
        found.pop()
    return tuple(least for least, _ in found), tuple(most for _, most in found)


def flatten(values: msgspec.Struct) -> dict[str, Any]:
    """Return the single values of a record by their dotted names, as plain numbers, texts and tuples."""
    return {leaf.name: _plain(_at(values, leaf), leaf) for leaf in fields_of(type(values))}


def nest(record: type[msgspec.Struct], flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested tables of flat values to build a record from, without lists of tables: the inverse of ``flatten``.

    An optional table is None if all its required values are null. Unknown names stay as they are.
    """
    tree: dict[str, Any] = {}
    structured = {leaf.name for leaf in fields_of(record) if leaf.structured}
    for name, value in flat.items():
        if name in structured:
            continue
        *path, last = name.split(".")
        table = tree
        for step in path:
            table = table.setdefault(step, {})
        table[last] = value
    return _pruned(record, tree)


def changed_names(one: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of ``one`` whose values differ in ``other``."""
    return tuple(name for name, value in one.items() if name not in other or other[name] != value)


def _fields_of(record: Any, prefix: str, outer: tuple[Meta, ...], optional: bool) -> Iterator[Field]:
    hints = get_type_hints(record, include_extras=True)
    for each in msgspec.structs.fields(record):
        found = unwrap(hints[each.name])
        name, metas = f"{prefix}{each.name}", found.metas
        if _is_table(found.kind):
            inherited = tuple(Meta(extra=meta.extra) for meta in metas if meta.extra)
            yield from _fields_of(found.kind, f"{name}.", (*outer, *inherited), optional or found.optional)
            continue
        default = each.default_factory() if each.default_factory is not msgspec.NODEFAULT else each.default
        missing = default is msgspec.NODEFAULT
        inner = element_type(found.kind)
        while inner is not None and element_type(inner.kind) is not None:
            inner = element_type(inner.kind)
        structured = inner is not None and (_is_table(inner.kind) or get_origin(inner.kind) is dict)
        leaf = Field(
            name,
            hints[each.name],
            found.kind,
            (*outer, *metas),
            found.optional or (missing and optional),
            structured,
            None,
        )
        yield leaf._replace(default=None if missing else _plain(default, leaf))


def _at(values: Any, leaf: Field) -> Any:
    """Return the value of a leaf; its default if the table around it is None."""
    for step in leaf.name.split("."):
        if values is None:
            return leaf.default
        values = getattr(values, step)
    return values


def _plain(value: Any, leaf: Field) -> Any:
    made = msgspec.to_builtins(value)
    return json.dumps(_stated(made))[:MAX_TEXT_LENGTH] if leaf.structured else _tuples(made)


def _stated(value: Any) -> Any:
    """Return the value without keys that are null."""
    if isinstance(value, dict):
        return {key: _stated(each) for key, each in value.items() if each is not None}
    return [_stated(each) for each in value] if isinstance(value, list | tuple) else value


def _tuples(value: Any) -> Any:
    return tuple(_tuples(each) for each in value) if isinstance(value, list | tuple) else value


def _pruned(record: Any, tree: dict[str, Any]) -> dict[str, Any]:
    hints = get_type_hints(record, include_extras=True)
    made = dict(tree)
    for each in msgspec.structs.fields(record):
        found = unwrap(hints[each.name])
        table = tree.get(each.name)
        if _is_table(found.kind) and isinstance(table, dict):
            required = [field.name for field in msgspec.structs.fields(found.kind) if field.required]
            stated = [table.get(name) for name in required] if required else list(table.values())
            empty = found.optional and all(value is None for value in stated)
            made[each.name] = None if empty else _pruned(found.kind, table)
    return made


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _sibling(leaf: Field, name: str) -> str:
    return f"{leaf.name[: leaf.name.rfind('.') + 1]}{name}"


def _length(kind: Any, metas: tuple[Meta, ...]) -> tuple[int, int]:
    """Return the bounds on the length of a list or text; for a fixed tuple, its length twice."""
    items = get_args(kind)
    if get_origin(kind) is tuple and Ellipsis not in items:
        return len(items), len(items)
    least = max((meta.min_length for meta in metas if meta.min_length is not None), default=0)
    return least, min((meta.max_length for meta in metas if meta.max_length is not None), default=0)


_NAMES = {bool: "bool", int: "int", float: "float", str: "str"}


def type_name(leaf: Field) -> tuple[str, tuple[str, ...]]:
    """Return the type as named in a description, such as ``float[]``, and its choices."""
    if leaf.structured:
        return "str", ()
    kind, brackets = leaf.kind, ""
    while (inner := element_type(kind)) is not None:
        kind, brackets = inner.kind, f"{brackets}[]"
    if get_origin(kind) is Literal:
        return f"str{brackets}", tuple(map(str, get_args(kind)))
    return f"{_NAMES[kind]}{brackets}", ()


def all_metas(leaf: Field) -> tuple[Meta, ...]:
    """Return the annotations of a leaf and of its elements, those of the elements first."""
    metas: tuple[Meta, ...] = leaf.metas
    kind = leaf.kind
    while (inner := element_type(kind)) is not None:
        kind, metas = inner.kind, (*inner.metas, *metas)
    return metas


class Constrained(Protocol):
    """A parameter with its constraints on others, as in its description."""

    @property
    def name(self) -> str: ...
    @property
    def at_most(self) -> str: ...
    @property
    def excludes(self) -> tuple[str, ...]: ...


def describe_range(description: ParameterDescription) -> str:
    """Return the bounds in words, with the unit: ``0 to 5 m/s``, ``above 0``, or an empty text."""
    low, high = description.low, description.high
    if low is None and high is None:
        return ""
    if low is not None and high is not None and not (description.above or description.below):
        text = f"{low:.12g} to {high:.12g}"
    else:
        least = "" if low is None else f"{'above' if description.above else 'at least'} {low:.12g}"
        most = "" if high is None else f"{'below' if description.below else 'at most'} {high:.12g}"
        text = " and ".join(each for each in (least, most) if each)
    return f"{text} {description.unit}".strip()


def describe_length(description: ParameterDescription) -> str:
    """Return the bounds of lengths in words: ``6 items``, ``at most 255 characters``."""
    depth = description.type.count("[]")
    parts = []
    for level, (least, most) in enumerate(zip(description.shortest, description.longest, strict=True)):
        what = "characters" if level == depth else "items"
        whose = "" if level == 0 else " each"
        low, high = f"at least {least}" if least else "", f"at most {most}" if most else ""
        bounds = str(least) if least == most else " and ".join(part for part in (low, high) if part)
        if least or most:
            parts.append(f"{bounds} {what}{whose}")
    return ", ".join(parts)


def describe_relations(description: Constrained) -> str:
    """Return the constraints on others in words: ``at most fastest``, ``not with a, b``, or an empty text."""
    most = f"at most {description.at_most}" if description.at_most else ""
    off = f"not with {', '.join(description.excludes)}" if description.excludes else ""
    return ", ".join(each for each in (most, off) if each)


def violations(
    related: Iterable[Constrained], values: Mapping[str, Any], concerned: Collection[str] | None = None
) -> Iterator[str]:
    """Yield a sentence for each violated constraint; with ``concerned``, only for constraints on one of these names.

    A null value satisfies every bound and is no bound for others; null and false count as off.
    """
    for each in related:
        value = values.get(each.name)
        if value is None:
            continue
        most = values.get(each.at_most)
        if most is not None and value > most and _one_of(concerned, each.name, each.at_most):
            yield f"{each.name} = {value} is above {each.at_most} = {most}, which it may not exceed"
        for other in each.excludes if value is not False else ():
            on = values.get(other)
            if on is not None and on is not False and _one_of(concerned, each.name, other):
                yield f"{each.name} = {value} and {other} = {on} exclude each other: one of them must be off"


def _one_of(concerned: Collection[str] | None, *names: str) -> bool:
    return concerned is None or any(name in concerned for name in names)


RENAMED_CHOICES = {"seed": "tutorial"}
"""Renamed choices, old to new, for parameters that have the new choice and not the old one."""


def renamed_choice(value: Any, choices: Collection[str]) -> str | None:
    """Return the new name of ``value`` if it is the old name of one of ``choices``, else None."""
    if not isinstance(value, str) or value in choices:
        return None
    new = RENAMED_CHOICES.get(value)
    return new if new in choices else None
