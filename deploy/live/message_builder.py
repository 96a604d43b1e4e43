"""Builds messages from typed text: YAML or JSON, subsets of the fields, ROS types, and ``now`` for times."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from msgspec import inspect

from messages.base import Message, WrongPayload, decoder, encode
from messages.std import Header, Time
from models.yaml_reader import read_yaml
from services.runtime.errors import BadInput, unknown_name
from services.runtime.field_path import element_type, field_types, nested_record

_TYPE = re.compile(r"[A-Za-z]\w*/(?:(?:msg|srv)/)?[A-Za-z]\w*")
_OPTION = re.compile(r"--?[A-Za-z]")


class _Now:
    """Placeholder for the time at which a message is sent."""


_NOW = _Now()


class MessageBuilder:
    """Builds messages from given values; headers without a stamp get one at each ``build``."""

    def __init__(self, record: type[Message], values: Sequence[str], stamped: bool = True) -> None:
        """Parse ``values``: one mapping, or the fields in order; raises BadInput with the path of a wrong one."""
        self.record = record
        self._decode = decoder(record)
        given = [read_yaml(each) for each in values]
        values_tree: Any = given[0] if len(given) == 1 and (isinstance(given[0], dict) or given[0] is None) else given
        try:
            self._tree = _arrange_record(record, values_tree, "", stamped)
            self.needs_clock = _contains_now(self._tree)
        except RecursionError:
            raise BadInput(f"{record.ROS_TYPE}: the values are nested too deeply") from None
        self.build(0)

    def build(self, now: int) -> Message:
        """Build the message for a simulation time [ns]."""
        time = Time.of(now)
        try:
            return self._decode(encode(_fill_now(self._tree, {"sec": time.sec, "nanosec": time.nanosec})))
        except WrongPayload as error:
            text, _, place = str(error).partition(" - at `$")
            where = place.rstrip("`").lstrip(".")
            hint = "; text that looks like something else needs quotes, as in '\"12\"'" if "`str`, got" in text else ""
            raise BadInput(f"{self.record.ROS_TYPE}{f' at {where}' if where else ''}: {text}{hint}") from None
        except (TypeError, NotImplementedError, OverflowError, RecursionError) as error:
            raise BadInput(f"{self.record.ROS_TYPE}: {error}") from None


def split_type(words: Sequence[str]) -> tuple[str, list[str]]:
    """Split off the leading ROS type, empty if there is none; return it and the remaining values.

    Raises BadInput for what looks like an option: unknown options arrive here, as negative numbers do.
    """
    for each in words:
        if _OPTION.match(each):
            raise BadInput(f"there is no option {each}")
    if words and _TYPE.fullmatch(words[0]):
        return words[0], list(words[1:])
    return "", list(words)


def _arrange_record(record: type[Message], value: Any, path: str, stamped: bool) -> Any:
    """Return the values of a record as a tree: names checked, fields given by position named, headers stamped."""
    names = field_types(record)
    if record is Time and value == "now":
        return _NOW
    if record is Header and value == "auto":
        value = {"stamp": "now"}
    if value is None:
        value = {}
    if not isinstance(value, dict | list):
        value = [value]
    if isinstance(value, list):
        if len(value) > len(names) or (len(value) < len(names) and path):
            raise BadInput(
                f"{path or record.ROS_TYPE}: {record.ROS_TYPE} has the fields {', '.join(names) or '(none)'}, "
                f"got {len(value)} value{'s' if len(value) != 1 else ''}; write {{name: value, ...}} to set some"
            )
        value = dict(zip(names, value, strict=False))
    tree: dict[str, Any] = {}
    for name, each in value.items():
        if name not in names:
            raise unknown_name("field", str(name), names, f"{path or record.ROS_TYPE}")
        tree[name] = _arrange_field(names[name], each, f"{path}.{name}" if path else str(name), stamped)
    if stamped:
        for name, kind in names.items():
            if nested_record(kind) is Header:
                tree.setdefault(name, {}).setdefault("stamp", _NOW)
    return tree


def _arrange_field(kind: inspect.Type, value: Any, path: str, stamped: bool) -> Any:
    record = nested_record(kind)
    if record is not None:
        return _arrange_record(record, value, path, stamped)
    element = element_type(kind)
    if isinstance(value, list) and element is not None:
        return [_arrange_field(element, each, f"{path}[{number}]", stamped) for number, each in enumerate(value)]
    if isinstance(kind, inspect.BytesType) and isinstance(value, list):
        try:
            return bytes(value)
        except (TypeError, ValueError) as error:
            raise BadInput(f"{path}: {error}") from None
    return value


def _fill_now(tree: Any, now: dict[str, int]) -> Any:
    if isinstance(tree, dict):
        return {name: _fill_now(each, now) for name, each in tree.items()}
    if isinstance(tree, list):
        return [_fill_now(each, now) for each in tree]
    return now if tree is _NOW else tree


def _contains_now(tree: Any) -> bool:
    inner = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return tree is _NOW or any(_contains_now(each) for each in inner)
