"""Parameter values as text: command-line words, YAML and TOML files, tables, JSON."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from deploy.live.output import printable
from messages.base import LARGEST
from messages.parameters import (
    Announcement,
    Assignment,
    ParameterChange,
    ParameterDescription,
    ParameterSchema,
    ParameterValues,
    SetParameters,
    Value,
)
from models.yaml_reader import read_yaml
from services.runtime.errors import BadInput, unknown_name

Format = Literal["yaml", "toml"]
MAX_FILE_BYTES = 8 << 20
"""Maximum size of a file [bytes]."""


def file_format(file: str, stated: str | None) -> Format:
    """Return the given format, else by the file's extension, else YAML; raises BadInput for another extension."""
    if stated is not None:
        return "toml" if stated == "toml" else "yaml"
    ending = Path(file).suffix.lower()
    if ending in (".yaml", ".yml", ""):
        return "yaml"
    if ending == ".toml":
        return "toml"
    raise BadInput(f"{file}: is it YAML or TOML? Give --format yaml or --format toml")


def read_parameter_file(path: Path, form: Format) -> dict[str, Any]:
    """Read the tables of a file; raises BadInput with the location of an error."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise BadInput(f"{path}: larger than {MAX_FILE_BYTES >> 20} MiB, too large for a parameter file")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise BadInput(f"{path} is not UTF-8 text: {error}") from None
    if form == "yaml":
        return read_table(text, str(path))
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise BadInput(f"{path}: {error}") from None


def read_table(text: str, where: str) -> dict[str, Any]:
    """Parse a YAML map with text keys, empty for an empty text; raises BadInput."""
    table = read_yaml(text, where)
    if table is None:
        return {}
    if not isinstance(table, dict) or not all(isinstance(key, str) for key in table):
        raise BadInput(f"{where}: expected a mapping from names to values, got {text.strip()[:60]!r}")
    return table


def read_yaml_value(text: str) -> Any:
    """Parse any YAML value; invalid YAML stays text."""
    try:
        return read_yaml(text)
    except BadInput:
        return text


def format_tables(tables: Mapping[str, Mapping[str, Value]], form: Format) -> str:
    """Format tables; values that are null are omitted in TOML, which has none."""
    plain = {name: {key: _plain(value) for key, value in table.items()} for name, table in tables.items()}
    if form == "toml":
        import tomli_w

        return tomli_w.dumps(plain)
    import yaml

    return yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, default_flow_style=None)


def _plain(value: Value) -> Any:
    return [_plain(each) for each in value] if isinstance(value, tuple) else value


YES = ("yes", "true", "t", "y", "on", "1")
NO = ("no", "false", "f", "n", "off", "0")
"""Words for booleans, in any case; a superset of dynamic_reconfigure's."""

_PAIR = re.compile(r"([A-Za-z_][A-Za-z0-9_.]*)=(.*)", re.DOTALL)


def parse_assignments(words: Sequence[str], schema: ParameterSchema) -> dict[str, Value]:
    """Parse ``NAME VALUE``, ``NAME=VALUE ...`` or a YAML map; raises BadInput."""
    if not words:
        raise BadInput("nothing to set: write NAME VALUE, NAME=VALUE ..., or a YAML map '{NAME: VALUE}'")
    if len(words) == 1 and words[0].lstrip().startswith("{"):
        table = read_table(words[0], "command line")
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
    return convert_values(table, schema)


def convert_values(table: Mapping[str, Any], schema: ParameterSchema) -> dict[str, Value]:
    """Convert values to their parameters' types where possible; raises BadInput for an unknown name."""
    described = {each.name: each for each in schema.parameters}
    for name in table:
        if name not in described:
            raise unknown_name("parameter", str(name), described, schema.set)
    values = {name: _convert_value(value, described[name]) for name, value in table.items()}
    for name, value in values.items():
        _check_representable(described[name], value)
    return values


def _check_representable(described: ParameterDescription, value: Value) -> None:
    """Raise BadInput for a number that no message can hold."""
    if isinstance(value, tuple):
        for each in value:
            _check_representable(described, each)
        return
    if not isinstance(value, int | float):
        return
    shown = f"{described.name} = {str(value)[:80]}"
    if isinstance(value, int) and described.type.startswith("int"):
        if not -(2**63) <= value < 2**63:
            raise BadInput(f"{shown}: an int has 64 bits")
    elif isinstance(value, float) and not math.isfinite(value):
        raise BadInput(f"{shown}: it is not finite")
    elif abs(value) > LARGEST:
        raise BadInput(f"{shown}: no number may exceed {LARGEST:g}")


def validate_change(
    schema: ParameterSchema, before: ParameterValues, values: Mapping[str, Value], clamp: bool = False
) -> None:
    """Raise BadInput with all violations for which the service would refuse a change, by the service's own rules.

    The service decides for one set at a time; a file with several sets is checked here before the first one changes.
    """
    from services.params.changes import plan_set
    from services.params.schema import Schema, SetState

    known = Schema(
        announced={node: Announcement(set=schema.set, node=node) for node in schema.nodes},
        parameters={each.name: each for each in schema.parameters},
    )
    now = {each.name: each.value for each in before.values}
    plan_set(
        SetState(schema.set, known, run=now),
        SetParameters(set=schema.set, values=to_assignments(values), clamp=clamp, run=True),
    )


def to_assignments(values: Mapping[str, Value]) -> tuple[Assignment, ...]:
    """Return values as assignments of a request."""
    return tuple(Assignment(name=name, value=value) for name, value in values.items())


def _convert_value(value: Any, described: ParameterDescription) -> Value:
    """Convert text to the parameter's type; other text stays, and is later refused by name."""
    if isinstance(value, str):
        return _convert_text(value, described)
    if isinstance(value, list | tuple):
        return _convert_list(value, described)
    if isinstance(value, bool | int | float) or value is None:
        return value
    raise BadInput(f"{described.name} = {value!r}: a parameter is a bool, number, text or list of them")


def _convert_text(text: str, described: ParameterDescription) -> Value:
    if described.optional and text.strip() in ("null", "~"):
        return None
    if described.type.endswith("[]"):
        value = read_yaml_value(text)
        return _convert_list(value, described) if isinstance(value, list) else text
    return _convert_scalar(text, described)


def _convert_scalar(text: str, described: ParameterDescription) -> Value:
    word = text.strip()
    match described.type.partition("[")[0]:
        case "str":
            near = [each for each in described.choices if each.casefold() == word.casefold()]
            return near[0] if len(near) == 1 else text
        case "bool":
            return word.lower() in YES if word.lower() in YES + NO else text
        case "int":
            return _convert_number(word, (int, float), text)
        case _:
            return _convert_number(word, (float,), text)


def _convert_number(word: str, kinds: Iterable[type], text: str) -> Value:
    for kind in kinds:
        try:
            number: Value = kind(word)
        except ValueError:
            continue
        return number
    return text


def _convert_list(values: Sequence[Any], described: ParameterDescription) -> Value:
    read: Any = tuple(
        _convert_list(each, described)
        if isinstance(each, list | tuple)
        else _convert_scalar(each, described)
        if isinstance(each, str)
        else each
        for each in values
    )
    items: Value = read
    return items


def format_value(value: Value) -> str:
    """Format a value as typed on the command line."""
    return printable(value) if isinstance(value, str) else json.dumps(value)


def values_as_json(record: ParameterValues) -> dict[str, Any]:
    """Return the values of a set as JSON."""
    values = {each.name: {"value": each.value, "origin": each.origin} for each in record.values}
    return {"set": record.set, "revision": record.revision, "values": values, "note": record.note}


def description_as_row(each: ParameterDescription) -> tuple[str, ...]:
    """Return name, type, bounds or choices, default, liveness and description."""
    from services.runtime.parameters.schema import describe_length, describe_range, describe_relations

    bounds = (
        describe_range(each) or each.unit or ", ".join(each.choices),
        describe_length(each),
        describe_relations(each),
    )
    allowed = ", ".join(part for part in bounds if part)
    kind = each.type + (" or null" if each.optional else "")
    return each.name, kind, allowed, format_value(each.default), "" if each.live else "at start only", each.text


def change_as_row(each: ParameterChange) -> tuple[str, ...]:
    """Return revision, set, kind, values, author and time."""
    wall = datetime.fromtimestamp(each.wall_time / 1e9).strftime("%Y-%m-%d %H:%M:%S")
    marks = ", ".join(mark for mark, set_ in (("run only", each.run), ("undone", each.undone)) if set_)
    kind = f"{each.kind} ({marks})" if marks else each.kind
    changed = format_changes(each.before, each.after)
    return str(each.revision), each.set, kind, changed, each.who, wall, f"{each.sim_time.ns / 1e9:.3f} s"


def format_changes(before: Iterable[Assignment], after: Iterable[Assignment]) -> str:
    """Format changes, e.g. ``kp 1.0 -> 2.0, kd 3.0 -> 4.0``."""
    old = {each.name: each.value for each in before}
    return ", ".join(f"{each.name} {format_value(old.get(each.name))} -> {format_value(each.value)}" for each in after)


def format_difference(before: ParameterValues, after: ParameterValues, names: Iterable[str]) -> str:
    """Format a line per name: its value, the previous one, and its origin."""
    old = {each.name: each for each in before.values}
    new = {each.name: each for each in after.values}
    lines = []
    for name in names:
        if name not in new:
            lines.append(f"{after.set} {name}: no longer stored\n")
            continue
        now, was = new[name], old.get(name)
        same = was is not None and was.value == now.value
        change = "is" if same or was is None else f"{format_value(was.value)} ->"
        lines.append(f"{after.set} {name}: {change} {format_value(now.value)}  ({now.origin})\n")
    return "".join(lines)
