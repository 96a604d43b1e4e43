"""Parameters from outside: read from text and tables, checked against the bounds that their record declares."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from services.runtime.errors import BadInput, unknown
from services.runtime.service import Parameters

P = TypeVar("P", bound=Parameters)


class Description(NamedTuple):
    """One parameter as it is shown: type, default, bounds, unit and text."""

    name: str
    type: str
    default: Any
    low: float | None
    high: float | None
    unit: str
    text: str

    @property
    def bounds(self) -> str:
        """``0 to 5``, ``at least 0``, or nothing."""
        match self.low, self.high:
            case None, None:
                return ""
            case low, None:
                return f"at least {low:g}"
            case None, high:
                return f"at most {high:g}"
            case low, high:
                return f"{low:g} to {high:g}"


def describe(record: type[Parameters]) -> Iterator[Description]:
    """Every parameter of a service, in the order of declaration."""
    hints = get_type_hints(record, include_extras=True)
    for each in msgspec.structs.fields(record):
        hint = hints[each.name]
        base, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        low = high = None
        unit = text = ""
        for note in notes:
            low = note.ge if note.ge is not None else note.gt if note.gt is not None else low
            high = note.le if note.le is not None else note.lt if note.lt is not None else high
            unit = (note.extra or {}).get("unit", unit)
            text = note.description or text
        name = getattr(base, "__name__", str(base)) if not get_args(base) else str(base)
        yield Description(each.name, name.replace("typing.", ""), each.default, low, high, unit, text)


def read_value(text: str) -> Any:
    """A value as JSON or TOML writes it; anything else is taken as a text."""
    try:
        return json.loads(text)
    except ValueError:
        pass
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text


def read_assignments(pairs: Iterable[str]) -> dict[str, Any]:
    """``name=value`` texts as a table; raises BadInput."""
    table: dict[str, Any] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise BadInput(f"--param {pair!r}: write it as name=value")
        table[name] = read_value(value)
    return table


def build(record: type[P], values: Mapping[str, Any], where: str = "") -> P:
    """The record with ``values``; raises BadInput with the parameter, the bound and the value."""
    prefix = f"{where}: " if where else ""
    names = [each.name for each in msgspec.structs.fields(record)]
    for name, value in values.items():
        if name not in names:
            raise unknown("parameter", name, names, where)
        if not _finite(value):
            raise BadInput(f"{prefix}parameter {name} = {value!r}: a number that is not finite")
    try:
        return msgspec.convert(dict(values), record)
    except msgspec.ValidationError as error:
        text = str(error)
        name = text.partition("`$.")[2].partition("`")[0].partition("[")[0]
        shown = f" {name} = {values[name]!r}" if name in values else ""
        raise BadInput(f"{prefix}parameter{shown}: {text}") from None


def _finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, list | tuple):
        return all(_finite(each) for each in value)
    if isinstance(value, dict):
        return all(_finite(each) for each in value.values())
    return True
