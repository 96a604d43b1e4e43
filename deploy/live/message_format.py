"""Formats messages as text: YAML as by the ROS tools, in block or flow style, and rows of CSV."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from typing import Any

from services.runtime.field_path import leaves

_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_/.+-]*")
_RESERVED_WORDS = {"null", "true", "false", "yes", "no", "on", "off"}
"""Words that YAML does not read as text."""

MAX_ELEMENTS = 128
"""Default maximum number of list elements shown, as in ``ros2 topic echo``."""


class TruncationMark(str):
    """A note in place of a value, shown unquoted."""

    __slots__ = ()


def truncate(value: Any, most: int | None = MAX_ELEMENTS, arrays: bool = True, strings: bool = True) -> Any:
    """Cut long lists, texts and bytes to ``most``; without ``arrays`` or ``strings`` show only their sizes."""
    if isinstance(value, dict):
        return {name: truncate(each, most, arrays, strings) for name, each in value.items()}
    if isinstance(value, list | bytes):
        kind = "bytes" if isinstance(value, bytes) else "values"
        if not arrays:
            return TruncationMark(f"<array of {len(value)} {kind}>")
        shown = [truncate(each, most, arrays, strings) for each in value[:most]]
        return shown if len(shown) == len(value) else [*shown, TruncationMark("...")]
    if isinstance(value, str):
        if not strings:
            return TruncationMark(f"<string of {len(value)} characters>")
        return value if most is None or len(value) <= most else value[:most] + "..."
    return value


def to_yaml(value: Any) -> str:
    """Format as YAML in block style, a field on each line."""
    lines: list[str] = []
    _block(value, "", lines)
    return "\n".join(lines) + "\n"


def to_flow_yaml(value: Any) -> str:
    """Format as YAML in flow style, all on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_text(name)}: {to_flow_yaml(each)}" for name, each in value.items()) + "}"
    if isinstance(value, list | bytes):
        return "[" + ", ".join(to_flow_yaml(each) for each in value) + "]"
    return _scalar(value)


def csv_cells(value: Any) -> list[tuple[str, str]]:
    """Return the columns of one row: the path of each scalar, and its value."""
    cells = []
    for path, leaf in leaves(value):
        elements = leaves(list(leaf), path) if isinstance(leaf, bytes) else [(path, leaf)]
        cells += [
            (place or "data", each if isinstance(each, str) else _scalar(each).lstrip(".")) for place, each in elements
        ]
    return cells


def csv_row(values: list[str]) -> str:
    """Format a line of CSV."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(values)
    return line.getvalue()


def _block(value: Any, indent: str, lines: list[str]) -> None:
    if isinstance(value, dict) and value:
        for name, each in value.items():
            _append_field(f"{indent}{_text(name)}:", each, indent, lines)
    elif isinstance(value, list | bytes) and value:
        for each in value:
            if isinstance(each, dict | list) and each:
                inner: list[str] = []
                _block(each, f"{indent}  ", inner)
                inner[0] = f"{indent}- {inner[0][len(indent) + 2 :]}"
                lines += inner
            else:
                lines.append(f"{indent}- {to_flow_yaml(each)}")
    else:
        lines.append(f"{indent}{to_flow_yaml(value)}")


def _append_field(head: str, value: Any, indent: str, lines: list[str]) -> None:
    """Append a field, its value beside the name or below it."""
    if isinstance(value, dict | list | bytes) and value:
        lines.append(head)
        _block(value, f"{indent}  " if isinstance(value, dict) else indent, lines)
    else:
        lines.append(f"{head} {to_flow_yaml(value)}")


def _scalar(value: Any) -> str:
    if isinstance(value, TruncationMark):
        return str(value) if value == "..." else f"'{value}'"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "null"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    return repr(value)


def _text(value: str) -> str:
    if value.lower() in _RESERVED_WORDS or not _PLAIN.fullmatch(value):
        quoted = escape_unprintable(json.dumps(value, ensure_ascii=False))
        return quoted if value else "''"
    return value


def escape_unprintable(text: str) -> str:
    """Escape the control characters in external text that a terminal would obey."""
    return "".join(map(_escape_character, text))


def _escape_character(character: str) -> str:
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\u{code:04x}" if code < 1 << 16 else f"\\U{code:08x}"
