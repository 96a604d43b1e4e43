"""A record of parameters as single values: nested tables under dotted names, lists of tables as JSON texts."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

LARGEST = 1e12
"""Bound of every finite number on the wire; a bound beyond it is none."""
LONGEST = 60_000
"""Characters of a JSON text; what is longer is cut, since it is only shown."""


class Leaf(NamedTuple):
    """One single value of a record: its dotted name, its type as declared and bare, what annotates it, and whether it
    may be null.

    ``structured`` are lists of tables, which travel as JSON texts. ``default`` is the record's own.
    """

    name: str
    hint: Any
    kind: Any
    metas: tuple[Meta, ...]
    optional: bool
    structured: bool
    default: Any

    def extra(self, key: str, default: Any) -> Any:
        """What the annotations say beside bounds and text; the outermost counts."""
        for meta in reversed(self.metas):
            if meta.extra is not None and key in meta.extra:
                return meta.extra[key]
        return default


class Relation(NamedTuple):
    """What must hold between a parameter and others of its record, by dotted names; see ``ParameterDescription``."""

    name: str
    at_most: str
    excludes: tuple[str, ...]


class Bare(NamedTuple):
    """A type hint taken apart; ``metas`` from the innermost to the outermost."""

    kind: Any
    metas: tuple[Meta, ...]
    optional: bool


def bare(hint: Any) -> Bare:
    """The type behind annotations and ``| None``."""
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
            return Bare(hint, metas, optional)


def elements(kind: Any) -> Bare | None:
    """The type of what a list or tuple holds; None for anything else."""
    if get_origin(kind) not in (tuple, list):
        return None
    return bare(get_args(kind)[0])


@cache
def leaves(record: type[msgspec.Struct]) -> tuple[Leaf, ...]:
    """The single values of a record, in the order of declaration."""
    return tuple(_leaves(record, "", (), False))


@cache
def relations(record: type[msgspec.Struct]) -> tuple[Relation, ...]:
    """The leaves whose annotations relate them to others, by names as seen from their own table."""
    return tuple(
        Relation(leaf.name, _beside(leaf, most) if most else "", tuple(_beside(leaf, each) for each in excluded))
        for leaf in leaves(record)
        for most, excluded in [(leaf.extra("at_most", ""), leaf.extra("excludes", ()))]
        if most or excluded
    )


def lengths(leaf: Leaf) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Least and most items of each level of a list, from the outside, then characters of a text; 0 is no bound."""
    if leaf.structured:
        return (), ()
    found, inner = [], Bare(leaf.kind, leaf.metas, False)
    while True:
        found.append(_length(*inner[:2]))
        if (next_ := elements(inner.kind)) is None:
            break
        inner = next_
    while found and found[-1] == (0, 0):
        found.pop()
    return tuple(least for least, _ in found), tuple(most for _, most in found)


def flatten(values: msgspec.Struct) -> dict[str, Any]:
    """Every single value of a record by its dotted name, as plain numbers, texts and tuples."""
    return {leaf.name: _plain(_at(values, leaf), leaf) for leaf in leaves(type(values))}


def nest(record: type[msgspec.Struct], flat: Mapping[str, Any]) -> dict[str, Any]:
    """The tables that ``flatten`` took apart, ready to build a record of, lists of tables left out.

    An optional table is None when all that it must state is null. Unknown names stay as they are.
    """
    tree: dict[str, Any] = {}
    structured = {leaf.name for leaf in leaves(record) if leaf.structured}
    for name, value in flat.items():
        if name in structured:
            continue
        *path, last = name.split(".")
        table = tree
        for step in path:
            table = table.setdefault(step, {})
        table[last] = value
    return _pruned(record, tree)


def differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[str, ...]:
    """The names whose values differ."""
    return tuple(name for name, value in one.items() if name not in other or other[name] != value)


def _leaves(record: Any, prefix: str, outer: tuple[Meta, ...], optional: bool) -> Iterator[Leaf]:
    hints = get_type_hints(record, include_extras=True)
    for each in msgspec.structs.fields(record):
        found = bare(hints[each.name])
        name, metas = f"{prefix}{each.name}", found.metas
        if _is_table(found.kind):
            inherited = tuple(Meta(extra=meta.extra) for meta in metas if meta.extra)
            yield from _leaves(found.kind, f"{name}.", (*outer, *inherited), optional or found.optional)
            continue
        default = each.default_factory() if each.default_factory is not msgspec.NODEFAULT else each.default
        missing = default is msgspec.NODEFAULT
        inner = elements(found.kind)
        while inner is not None and elements(inner.kind) is not None:
            inner = elements(inner.kind)
        structured = inner is not None and (_is_table(inner.kind) or get_origin(inner.kind) is dict)
        leaf = Leaf(
            name,
            hints[each.name],
            found.kind,
            (*outer, *metas),
            found.optional or (missing and optional),
            structured,
            None,
        )
        yield leaf._replace(default=None if missing else _plain(default, leaf))


def _at(values: Any, leaf: Leaf) -> Any:
    """The value of a leaf; the default of its own record where the table around it is None."""
    for step in leaf.name.split("."):
        if values is None:
            return leaf.default
        values = getattr(values, step)
    return values


def _plain(value: Any, leaf: Leaf) -> Any:
    made = msgspec.to_builtins(value)
    return json.dumps(_stated(made))[:LONGEST] if leaf.structured else _tuples(made)


def _stated(value: Any) -> Any:
    """Without the keys that are null."""
    if isinstance(value, dict):
        return {key: _stated(each) for key, each in value.items() if each is not None}
    return [_stated(each) for each in value] if isinstance(value, list | tuple) else value


def _tuples(value: Any) -> Any:
    return tuple(_tuples(each) for each in value) if isinstance(value, list | tuple) else value


def _pruned(record: Any, tree: dict[str, Any]) -> dict[str, Any]:
    hints = get_type_hints(record, include_extras=True)
    made = dict(tree)
    for each in msgspec.structs.fields(record):
        found = bare(hints[each.name])
        table = tree.get(each.name)
        if _is_table(found.kind) and isinstance(table, dict):
            required = [field.name for field in msgspec.structs.fields(found.kind) if field.required]
            stated = [table.get(name) for name in required] if required else list(table.values())
            empty = found.optional and all(value is None for value in stated)
            made[each.name] = None if empty else _pruned(found.kind, table)
    return made


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _beside(leaf: Leaf, name: str) -> str:
    return f"{leaf.name[: leaf.name.rfind('.') + 1]}{name}"


def _length(kind: Any, metas: tuple[Meta, ...]) -> tuple[int, int]:
    """The bounds of a list's items or a text's characters; of a tuple of so many, that number."""
    items = get_args(kind)
    if get_origin(kind) is tuple and Ellipsis not in items:
        return len(items), len(items)
    least = max((meta.min_length for meta in metas if meta.min_length is not None), default=0)
    return least, min((meta.max_length for meta in metas if meta.max_length is not None), default=0)


_NAMES = {bool: "bool", int: "int", float: "float", str: "str"}


def type_name(leaf: Leaf) -> tuple[str, tuple[str, ...]]:
    """The type as a description names it, ``float[]`` for one, and its choices."""
    if leaf.structured:
        return "str", ()
    kind, brackets = leaf.kind, ""
    while (inner := elements(kind)) is not None:
        kind, brackets = inner.kind, f"{brackets}[]"
    if get_origin(kind) is Literal:
        return f"str{brackets}", tuple(map(str, get_args(kind)))
    return f"{_NAMES[kind]}{brackets}", ()


def all_metas(leaf: Leaf) -> tuple[Meta, ...]:
    """The annotations of a leaf and of its elements, the elements' first."""
    metas: tuple[Meta, ...] = leaf.metas
    kind = leaf.kind
    while (inner := elements(kind)) is not None:
        kind, metas = inner.kind, (*inner.metas, *metas)
    return metas
