"""Whether a value fits the description of a parameter, and what it would be within the bounds."""

from __future__ import annotations

import math
import re
from typing import Any, NamedTuple

from messages.base import LARGEST
from messages.parameters import ParameterDescription, Value
from services.runtime.errors import BadInput
from services.runtime.parameters.allowed import long, within

_TYPE = re.compile(r"(bool|int|float|str)((?:\[\]){0,2})")
_WHOLE = 2**63
_MOST_NOTES = 100
_LONGEST = 65_536
"""Characters of a text, as on the wire."""


class Fit(NamedTuple):
    """A value as it will be used, and what was done to make it fit."""

    value: Value
    notes: tuple[str, ...] = ()


def taken_apart(type_name: str) -> tuple[str, int] | None:
    """``float[][]`` as ("float", 2), or None when it is not a type of parameters."""
    found = _TYPE.fullmatch(type_name)
    return (found[1], len(found[2]) // 2) if found else None


def fit(description: ParameterDescription, value: Value, clamp: bool = False) -> Fit:
    """The value in the parameter's type; raises BadInput with its name, the value and the bound.

    An integer is taken for a float; a bool is neither. ``clamp`` takes a number that is out of bounds at the bound.
    """
    name = description.name
    if value is None:
        if description.optional:
            return Fit(None)
        raise BadInput(f"{name} = null: a value is needed, {expected(description)}")
    parts = taken_apart(description.type)
    if parts is None:
        raise BadInput(f"{name}: its type {description.type!r} is not one of parameters")
    notes: list[str] = []
    fitted = _fit(description, value, parts, name, 0, notes if clamp else None)
    return Fit(fitted, tuple(notes))


def expected(description: ParameterDescription) -> str:
    """``float, 0 to 5 m/s``: what may be given."""
    what = [description.type + (" or null" if description.optional else ""), within(description), long(description)]
    if description.choices:
        what.append("one of " + ", ".join(description.choices))
    return ", ".join(each for each in what if each)


def _fit(
    description: ParameterDescription,
    value: Any,
    parts: tuple[str, int],
    where: str,
    level: int,
    notes: list[str] | None,
) -> Value:
    base, depth = parts
    if depth:
        if not isinstance(value, tuple | list):
            raise BadInput(f"{where} = {shown(value)}: expected a list, {expected(description)}")
        _check_length(description, value, where, level)
        inner = base, depth - 1
        items: Any = (_fit(description, each, inner, f"{where}[{i}]", level + 1, notes) for i, each in enumerate(value))
        return tuple(items)
    if isinstance(value, tuple | list):
        raise BadInput(f"{where} = {shown(value)}: expected no list, {expected(description)}")
    match base:
        case "bool":
            if type(value) is not bool:
                raise _wrong(description, value, where)
            return value
        case "str":
            if type(value) is not str:
                raise _wrong(description, value, where)
            _check_length(description, value, where, level)
            return _text(description, value, where)
        case "int":
            if type(value) is not int:
                raise _wrong(description, value, where)
            if not -_WHOLE <= value < _WHOLE:
                raise BadInput(f"{where} = {shown(value)}: an int has 64 bits")
            return _number(description, value, where, notes)
        case _:
            if type(value) not in (int, float):
                raise _wrong(description, value, where)
            if isinstance(value, float) and not math.isfinite(value):
                raise BadInput(f"{where} = {value}: it is not finite, expected {expected(description)}")
            if abs(value) > LARGEST:
                raise BadInput(f"{where} = {shown(value)}: no number may exceed {LARGEST:g}")
            return float(_number(description, float(value), where, notes))


def _wrong(description: ParameterDescription, value: Any, where: str) -> BadInput:
    return BadInput(f"{where} = {shown(value)}: it is {_kind(value)}, expected {expected(description)}")


def _check_length(description: ParameterDescription, value: Any, where: str, level: int) -> None:
    least, most = (each[level] if level < len(each) else 0 for each in (description.shortest, description.longest))
    if len(value) < least or 0 < most < len(value):
        raise BadInput(f"{where} = {shown(value)}: it has length {len(value)}, expected {expected(description)}")


def _text(description: ParameterDescription, value: str, where: str) -> str:
    if len(value) > _LONGEST:
        raise BadInput(f"{where}: a text of {len(value)} characters, at most {_LONGEST} are taken")
    if description.choices and value not in description.choices:
        raise BadInput(f"{where} = {shown(value)}: expected one of {', '.join(description.choices)}")
    return value


def _number(description: ParameterDescription, value: float, where: str, notes: list[str] | None) -> float:
    low, high = description.low, description.high
    if _too_low(description, value):
        assert low is not None
        bound, excluded = low, description.above
    elif _too_high(description, value):
        assert high is not None
        bound, excluded = high, description.below
    else:
        return value
    if notes is None:
        raise BadInput(_outside(description, value, where))
    nearest = float(bound)
    if type(value) is int:
        inward = 1 if bound == low else -1
        whole = math.ceil(bound) if inward > 0 else math.floor(bound)
        nearest = whole + inward if excluded and whole == bound else whole
    if _too_low(description, nearest) or _too_high(description, nearest):
        why = "the bound itself is excluded" if excluded else "nothing lies within"
        raise BadInput(f"{_outside(description, value, where)}; it cannot be clamped, {why}")
    few = len(notes) < _MOST_NOTES  # the others are not told, and a list has thousands of them
    notes.append(f"{where} = {value!r} was clamped to {nearest!r} ({within(description)})" if few else where)
    return nearest


def _outside(description: ParameterDescription, value: float, where: str) -> str:
    return f"{where} = {value!r} is out of bounds: {within(description)}"


def _too_low(description: ParameterDescription, value: float) -> bool:
    low = description.low
    return low is not None and (value < low or (description.above and value == low))


def _too_high(description: ParameterDescription, value: float) -> bool:
    high = description.high
    return high is not None and (value > high or (description.below and value == high))


def shown(value: Any) -> str:
    """A value in an error, no longer than one can read."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _kind(value: Any) -> str:
    names = {bool: "a bool", int: "an int", float: "a float", str: "a text", type(None): "null"}
    return names.get(type(value), f"a {type(value).__name__}")
