"""Reads parameters from text and tables, and checks them against the bounds that their record declares."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

import msgspec
from msgspec import Meta

from messages.base import LARGEST
from messages.parameters import ParameterDescription
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.schema import (
    Field,
    all_metas,
    constraints_of,
    fields_of,
    flatten,
    lengths,
    renamed_choice,
    type_name,
    violations,
)

P = TypeVar("P", bound=Parameters)


_NOTHING = object()


def describe_parameters(record: type[Parameters], defaults: Parameters | None = None) -> Iterator[ParameterDescription]:
    """Describe every parameter of a service in the order of declaration, with the record's defaults or those given.

    ``Meta(extra=...)`` of the annotations adds ``unit``; ``live``, false if a running service does not apply its
    changes; ``level``, the bit that is set when it changes, 1 by default; ``at_most`` and ``excludes``, constraints on
    other parameters of its table. Nested tables have dotted names. Bounds of a list are those of its elements. A list
    of tables is a JSON text that is never live.
    """
    given = flatten(defaults) if defaults is not None else {}
    related = {each.name: each for each in constraints_of(record)}
    for leaf in fields_of(record):
        kind, choices = type_name(leaf)
        metas = () if leaf.structured else all_metas(leaf)
        low, above = _bound(metas, "ge", "gt")
        high, below = _bound(metas, "le", "lt")
        shortest, longest = lengths(leaf)
        yield ParameterDescription(
            name=leaf.name,
            type=kind,
            default=given.get(leaf.name, leaf.default),
            low=low,
            high=high,
            above=above,
            below=below,
            choices=choices,
            shortest=shortest,
            longest=longest,
            at_most=related[leaf.name].at_most if leaf.name in related else "",
            excludes=related[leaf.name].excludes if leaf.name in related else (),
            optional=leaf.optional,
            unit=next((meta.extra["unit"] for meta in reversed(metas) if meta.extra and meta.extra.get("unit")), ""),
            text=next((meta.description for meta in reversed(leaf.metas) if meta.description), ""),
            live=bool(leaf.extra("live", True)) and not leaf.structured,
            level=leaf.extra("level", 1),
        )


def read_value(text: str) -> Any:
    """Parse a value written as JSON or TOML; anything else is text."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        pass
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except (ValueError, RecursionError):
        return text


def read_assignments(pairs: Iterable[str], option: str = "--param") -> dict[str, Any]:
    """Parse ``name=value`` texts into a table; raises BadInput."""
    table: dict[str, Any] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise BadInput(f"{option} {pair!r}: write it as name=value")
        table[name] = read_value(value)
    return table


def build(record: type[P], values: Mapping[str, Any], where: str = "") -> P:
    """Build a record with ``values``; raises BadInput with the parameter, its value and bound, or a contradiction."""
    prefix = f"{where}: " if where else ""
    names = record.__struct_fields__
    for name, value in values.items():
        if name not in names:
            raise unknown_name("parameter", name, names, where)
        if not _finite(value):
            raise BadInput(f"{prefix}parameter {name} = {value!r}: a number that is not finite")
    try:
        made = msgspec.convert(dict(values), record)
    except msgspec.ValidationError as error:
        text = str(error)
        name = text.partition("`$.")[2].partition("`")[0].partition("[")[0]
        value = _at(values, name.split("."))
        shown = "" if value is _NOTHING else f" {name} = {value!r}"
        leaf = next((each for each in fields_of(record) if each.name == name), None)
        raise BadInput(f"{prefix}parameter{shown}: {_choice_error(leaf, value) or text}") from None
    if (related := constraints_of(record)) and (faults := list(violations(related, flatten(made)))):
        raise BadInput(f"{prefix}{'; '.join(faults)}")
    return made


def check_value(record: type[Parameters], name: str, value: Any, where: str = "") -> None:
    """Raise BadInput unless the parameter ``name`` (dotted in a table) can be set to ``value`` at run time."""
    prefix = f"{where}: " if where else ""
    known = {leaf.name: leaf for leaf in fields_of(record)}
    if name not in known:
        raise unknown_name("parameter", name, known, where)
    leaf = known[name]
    if leaf.structured or not leaf.extra("live", True):
        raise BadInput(f"{prefix}parameter {name} cannot change while its service runs: set it at its start")
    if not _finite(value):
        raise BadInput(f"{prefix}parameter {name} = {value!r}: a number that is not finite")
    try:
        msgspec.convert(value, leaf.hint | None if leaf.optional else leaf.hint)
    except msgspec.ValidationError as error:
        raise BadInput(f"{prefix}parameter {name} = {value!r}: {_choice_error(leaf, value) or error}") from None


def stated(record: type[Parameters], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the single values stated in a table by dotted names, checked and typed by the record; raises BadInput."""
    made = flatten(build(record, values))
    return {name: value for name, value in made.items() if _at(values, name.split(".")) is not _NOTHING}


def _at(table: Any, path: list[str]) -> Any:
    """Return the value at a path of names in nested tables, or _NOTHING."""
    for step in path:
        if not isinstance(table, Mapping) or step not in table:
            return _NOTHING
        table = table[step]
    return table


def _bound(metas: Iterable[Meta], inclusive: str, exclusive: str) -> tuple[float | None, bool]:
    """Return the innermost annotation's bound and whether it is exclusive; None at or beyond the wire's own bound."""
    for meta in metas:
        for name in (inclusive, exclusive):
            value = getattr(meta, name)
            if value is not None:
                return (float(value), name == exclusive) if abs(value) < LARGEST else (None, False)
    return None, False


def _choice_error(leaf: Field | None, value: Any) -> str:
    """Return the error text for a value that is not one of the parameter's choices; empty for other parameters."""
    choices = type_name(leaf)[1] if leaf is not None else ()
    if not choices or not isinstance(value, str):
        return ""
    if new := renamed_choice(value, choices):
        return f"it is called {new!r} now"
    return f"expected one of {', '.join(choices)}"


def _finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, list | tuple):
        return all(_finite(each) for each in value)
    if isinstance(value, dict):
        return all(_finite(each) for each in value.values())
    return True
