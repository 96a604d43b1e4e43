"""Values as a person writes them, read by the type that the parameter has."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from messages.parameters import (
    Announcement,
    Assignment,
    ParameterDescription,
    ParameterSchema,
    ParameterValues,
    SetParameters,
    Value,
)
from services.runtime.errors import BadInput, unknown

YES = ("yes", "true", "t", "y", "on", "1")
NO = ("no", "false", "f", "n", "off", "0")
"""What is taken for a bool, in any case; dynamic_reconfigure took ``yes``, ``true``, ``t`` and ``1`` for true."""

_PAIR = re.compile(r"([A-Za-z_][A-Za-z0-9_.]*)=(.*)", re.DOTALL)


def given(words: Sequence[str], schema: ParameterSchema) -> dict[str, Value]:
    """The values in ``NAME VALUE``, ``NAME=VALUE ...`` or a YAML map; raises BadInput."""
    if not words:
        raise BadInput("nothing to set: write NAME VALUE, NAME=VALUE ..., or a YAML map '{NAME: VALUE}'")
    if len(words) == 1 and words[0].lstrip().startswith("{"):
        from deploy.commands.param.files import read_yaml

        table = read_yaml(words[0], "command line")
    elif pairs := [_PAIR.fullmatch(each) for each in words]:
        matched = [each for each in pairs if each is not None]
        if len(matched) == len(words):
            table = {}
            for each in matched:
                if each[1] in table:
                    raise BadInput(f"{each[1]} is given twice")
                table[each[1]] = each[2]
        elif len(words) == 2 and pairs[0] is None:
            table = {words[0]: words[1]}
        else:
            raise BadInput(f"{' '.join(words)!r}: write NAME VALUE, NAME=VALUE ..., or a YAML map '{{NAME: VALUE}}'")
    return fitting(table, schema)


def fitting(table: Mapping[str, Any], schema: ParameterSchema) -> dict[str, Value]:
    """Values in their parameters' types as far as they can be read so; raises BadInput for an unknown name."""
    described = {each.name: each for each in schema.parameters}
    for name in table:
        if name not in described:
            raise unknown("parameter", str(name), described, schema.set)
    return {name: _typed(value, described[name]) for name, value in table.items()}


def check(schema: ParameterSchema, before: ParameterValues, values: Mapping[str, Value], clamp: bool = False) -> None:
    """Refuse here, with every violation, what the service would refuse for ``before`` it; raises BadInput."""
    from services.params.change import plan_set
    from services.params.schema import Schema
    from services.params.state import State

    known = Schema(
        announced={node: Announcement(set=schema.set, node=node) for node in schema.nodes},
        parameters={each.name: each for each in schema.parameters},
    )
    now = {each.name: each.value for each in before.values}
    plan_set(
        State(schema.set, known, run=now), SetParameters(set=schema.set, values=assigned(values), clamp=clamp, run=True)
    )


def assigned(values: Mapping[str, Value]) -> tuple[Assignment, ...]:
    """As a request has them."""
    return tuple(Assignment(name=name, value=value) for name, value in values.items())


def _typed(value: Any, described: ParameterDescription) -> Value:
    """A text is read by the parameter's type; what cannot be read so stays as it is, and is refused by name later."""
    if isinstance(value, str):
        return _of_text(value, described)
    if isinstance(value, list | tuple):
        return _list(value, described)
    if isinstance(value, bool | int | float) or value is None:
        return value
    raise BadInput(f"{described.name} = {value!r}: a parameter is a bool, number, text or list of them")


def _of_text(text: str, described: ParameterDescription) -> Value:
    if described.optional and text.strip() in ("null", "~"):
        return None
    if described.type.endswith("[]"):
        from deploy.commands.param.files import read_yaml_value

        value = read_yaml_value(text)
        return _list(value, described) if isinstance(value, list) else text
    return _scalar(text, described)


def _scalar(text: str, described: ParameterDescription) -> Value:
    word = text.strip()
    match described.type.partition("[")[0]:
        case "str":
            near = [each for each in described.choices if each.casefold() == word.casefold()]
            return near[0] if len(near) == 1 else text
        case "bool":
            return word.lower() in YES if word.lower() in YES + NO else text
        case "int":
            return _number(word, (int, float), text)
        case _:
            return _number(word, (float,), text)


def _number(word: str, kinds: Iterable[type], text: str) -> Value:
    for kind in kinds:
        try:
            number: Value = kind(word)
        except ValueError:
            continue
        return number
    return text


def _list(values: Sequence[Any], described: ParameterDescription) -> Value:
    read: Any = tuple(
        _list(each, described)
        if isinstance(each, list | tuple)
        else _scalar(each, described)
        if isinstance(each, str)
        else each
        for each in values
    )
    items: Value = read
    return items
