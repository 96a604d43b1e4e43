"""Checks expressions against the values that real rospy prints."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Mapping
from typing import Any


def check(expected: str, names: Mapping[str, Any]) -> None:
    """Evaluate the expression left of ``->`` (a value) or ``!!`` (an exception) of each line; all must be as stated.

    A line that is indented by four more spaces continues the one before.
    """
    joined = expected.strip("\n ").replace("\n" + " " * 12, " ")
    lines = [line.removeprefix(" " * 8) for line in joined.splitlines()]
    shown = [_shown(line.split(" -> ")[0].split(" !! ")[0], names) for line in lines]
    difference = "\n".join(difflib.unified_diff(lines, shown, "real rospy", "ours", lineterm="", n=0))
    assert not difference, difference


def _shown(expression: str, names: Mapping[str, Any]) -> str:
    try:
        value = eval(compile(ast.parse(expression, mode="eval"), "golden", "eval"), dict(names))
    except Exception as error:  # noqa: BLE001 - every exception is a line
        return f"{expression} !! {type(error).__module__}.{type(error).__name__}: {error}"
    return f"{expression} -> {value!r}".replace("\n", "\\n")
