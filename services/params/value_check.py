"""Checks a value against the description of its parameter, and clamps it to the bounds on request."""

from __future__ import annotations

import math
import re
from typing import Any, NamedTuple

from messages.base import LARGEST
from messages.parameters import ParameterDescription, Value
from services.runtime.errors import BadInput
from services.runtime.parameters.schema import describe_length, describe_range, renamed_choice

_TYPE = re.compile(r"(bool|int|float|str)((?:\[\]){0,2})")
_INT_LIMIT = 2**63
_MAX_NOTES = 100
_MAX_TEXT_LENGTH = 65_536
"""Maximum characters of a text, as in a message."""


class FittedValue(NamedTuple):
    """A valid value, and notes about its conversion."""

    value: Value
    notes: tuple[str, ...] = ()


def parse_type(type_name: str) -> tuple[str, int] | None:
    """Parse ``float[][]`` into ("float", 2); returns None if it is not a parameter type."""
    found = _TYPE.fullmatch(type_name)
    return (found[1], len(found[2]) // 2) if found else None


def fit(description: ParameterDescription, value: Value, clamp: bool = False) -> FittedValue:
    """Convert a value to the parameter's type; raises BadInput with its name, the value and the bound.

    An int is accepted for a float; a bool is neither. With ``clamp``, a number out of bounds becomes the bound.
    """
    name = description.name
    if value is None:
        if description.optional:
            return FittedValue(None)
        raise BadInput(f"{name} = null: a value is needed, {describe_expected(description)}")
    parts = parse_type(description.type)
    if parts is None:
        raise BadInput(f"{name}: its type {description.type!r} is not one of parameters")
    notes: list[str] = []
    fitted = _fit(description, value, parts, name, 0, notes if clamp else None)
    return FittedValue(fitted, tuple(notes))


def describe_expected(description: ParameterDescription) -> str:
    """Describe the type and the allowed values: ``float, 0 to 5 m/s``."""
    what = [
        description.type + (" or null" if description.optional else ""),
        describe_range(description),
        describe_length(description),
    ]
    if description.choices:
        what.append(f"one of {_list_choices(description)}")
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
            raise BadInput(f"{where} = {format_value(value)}: expected a list, {describe_expected(description)}")
        _check_length(description, value, where, level)
        inner = base, depth - 1
        items: Any = (_fit(description, each, inner, f"{where}[{i}]", level + 1, notes) for i, each in enumerate(value))
        return tuple(items)
    if isinstance(value, tuple | list):
        raise BadInput(f"{where} = {format_value(value)}: expected no list, {describe_expected(description)}")
    match base:
        case "bool":
            if type(value) is not bool:
                raise _type_error(description, value, where)
            return value
        case "str":
            value = _choice_of(description, value)
            if type(value) is not str:
                raise _type_error(description, value, where)
            _check_length(description, value, where, level)
            return _fit_text(description, value, where)
        case "int":
            if type(value) is not int:
                raise _type_error(description, value, where)
            if not -_INT_LIMIT <= value < _INT_LIMIT:
                raise BadInput(f"{where} = {format_value(value)}: an int has 64 bits")
            return _fit_number(description, value, where, notes)
        case _:
            if type(value) not in (int, float):
                raise _type_error(description, value, where)
            if isinstance(value, float) and not math.isfinite(value):
                raise BadInput(f"{where} = {value}: it is not finite, expected {describe_expected(description)}")
            if abs(value) > LARGEST:
                raise BadInput(f"{where} = {format_value(value)}: no number may exceed {LARGEST:g}")
            return float(_fit_number(description, float(value), where, notes))


def _type_error(description: ParameterDescription, value: Any, where: str) -> BadInput:
    return BadInput(
        f"{where} = {format_value(value)}: it is {_type_text(value)}, expected {describe_expected(description)}"
    )


def _check_length(description: ParameterDescription, value: Any, where: str, level: int) -> None:
    least, most = (each[level] if level < len(each) else 0 for each in (description.shortest, description.longest))
    if len(value) < least or 0 < most < len(value):
        raise BadInput(
            f"{where} = {format_value(value)}: it has length {len(value)}, expected {describe_expected(description)}"
        )


def _choice_of(description: ParameterDescription, value: Any) -> Any:
    """Return the choice whose value is ``value``; ``value`` itself if it is a choice or there is none."""
    if isinstance(value, bool) or value in description.choices:
        return value
    named = zip(description.choices, description.choice_values, strict=False)
    return next((choice for choice, meant in named if _is_same(meant, value)), value)


def _is_same(text: str, value: str | float) -> bool:
    """Return whether a text and a value are equal, compared as numbers if both are numbers."""
    try:
        return float(text) == float(value)
    except ValueError:
        return text == value


def _fit_text(description: ParameterDescription, value: str, where: str) -> str:
    if len(value) > _MAX_TEXT_LENGTH:
        raise BadInput(f"{where}: a text of {len(value)} characters, the limit is {_MAX_TEXT_LENGTH}")
    if new := renamed_choice(value, description.choices):
        raise BadInput(f"{where} = {format_value(value)}: it is called {new!r} now")
    if description.choices and value not in description.choices:
        raise BadInput(f"{where} = {format_value(value)}: expected one of {_list_choices(description)}")
    return value


def _list_choices(description: ParameterDescription) -> str:
    """List the choices, each with its value if they have values."""
    if not description.choice_values:
        return ", ".join(description.choices)
    return ", ".join(f"{a} ({b})" for a, b in zip(description.choices, description.choice_values, strict=False))


def _fit_number(description: ParameterDescription, value: float, where: str, notes: list[str] | None) -> float:
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
        raise BadInput(_out_of_bounds_text(description, value, where))
    nearest = float(bound)
    if type(value) is int:
        inward = 1 if bound == low else -1
        whole = math.ceil(bound) if inward > 0 else math.floor(bound)
        nearest = whole + inward if excluded and whole == bound else whole
    if _too_low(description, nearest) or _too_high(description, nearest):
        why = "the bound itself is excluded" if excluded else "no value lies within"
        raise BadInput(f"{_out_of_bounds_text(description, value, where)}; it cannot be clamped, {why}")
    few = len(notes) < _MAX_NOTES  # further ones are not shown, and a list may have thousands
    notes.append(f"{where} = {value!r} was clamped to {nearest!r} ({describe_range(description)})" if few else where)
    return nearest


def _out_of_bounds_text(description: ParameterDescription, value: float, where: str) -> str:
    return f"{where} = {value!r} is out of bounds: {describe_range(description)}"


def _too_low(description: ParameterDescription, value: float) -> bool:
    low = description.low
    return low is not None and (value < low or (description.above and value == low))


def _too_high(description: ParameterDescription, value: float) -> bool:
    high = description.high
    return high is not None and (value > high or (description.below and value == high))


def format_value(value: Any) -> str:
    """Format a value for an error message, truncated to 80 characters."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _type_text(value: Any) -> str:
    names = {bool: "a bool", int: "an int", float: "a float", str: "a text", type(None): "null"}
    return names.get(type(value), f"a {type(value).__name__}")
