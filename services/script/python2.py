"""Converts Python 2 source to Python 3 with fissix, which continues lib2to3; every line keeps its number."""

from __future__ import annotations

import re
import warnings
from functools import cache
from typing import Any, NoReturn

_FIXERS = (
    "apply",
    "basestring",
    "dict",
    "except",
    "exec",
    "execfile",
    "filter",
    "funcattrs",
    "getcwdu",
    "has_key",
    "imports",
    "imports2",
    "input",
    "itertools",
    "itertools_imports",
    "long",
    "map",
    "metaclass",
    "methodattrs",
    "ne",
    "next",
    "nonzero",
    "numliterals",
    "paren",
    "print",
    "raise",
    "raw_input",
    "renames",
    "repr",
    "standarderror",
    "sys_exc",
    "throw",
    "tuple_params",
    "types",
    "unicode",
    "urllib",
    "xrange",
    "zip",
)
"""Fixers that keep all lines in place; ``reduce`` and similar functions are provided as builtins."""

_LEFTOVERS = re.compile(r"\.has_key\(|\.iter(?:items|keys|values)\(|^\s*print\s*>>", re.MULTILINE)
"""Matches code that only works in Python 2, in a text that Python 3 can parse as well."""
_TAB = 8
_QUOTES = re.compile(r"\"\"\"|'''|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'|#[^\n]*")


def looks_like_python2(source: str) -> bool:
    """Return whether a text that Python 3 parses uses methods or statements of Python 2 only."""
    return _LEFTOVERS.search(source) is not None


def convert(source: str, name: str) -> str:
    """Convert the text to Python 3; raises SyntaxError if it is not Python 2 either."""
    text = source if source.endswith("\n") else source + "\n"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from fissix.pgen2.parse import ParseError
        from fissix.pgen2.tokenize import TokenError

        try:
            return str(_refactoring().refactor_string(expand_tabs(text), name))
        except ParseError as error:
            line, column = error.context[1]
            lines = text.splitlines() or [""]
            shown = lines[min(line, len(lines)) - 1]
            raise SyntaxError("invalid syntax, in Python 2 as well", (name, line, column + 1, shown)) from None
        except (TokenError, IndentationError, ValueError, AttributeError) as error:
            raise SyntaxError(f"neither Python 3 nor Python 2: {error}", (name, 1, 0, "")) from None


def expand_tabs(source: str) -> str:
    """Expand tabs in indentation as Python 2 does, to multiples of 8; those in string literals stay."""
    lines, closing = [], ""
    for line in source.splitlines(keepends=True):
        if closing:
            lines.append(line)
        else:
            body = line.lstrip(" \t\f")
            lines.append(line[: len(line) - len(body)].expandtabs(_TAB) + body)
        closing = _open_text(line, closing)
    return "".join(lines)


def _open_text(line: str, closing: str) -> str:
    """Return the quotes that would end the string open at the end of a line; empty if none is."""
    place = 0
    while True:
        if closing:
            found = line.find(closing, place)
            if found < 0:
                return closing
            place, closing = found + 3, ""
        match = _QUOTES.search(line, place)
        if match is None:
            return ""
        place = match.end()
        if match[0] in ('"""', "'''"):
            closing = match[0]


@cache
def _refactoring() -> Any:
    from fissix.refactor import RefactoringTool

    class Quiet(RefactoringTool):  # type: ignore[misc]
        """A RefactoringTool that logs nothing."""

        def log_message(self, msg: Any, *args: Any) -> None:
            pass

        def log_error(self, msg: Any, *args: Any, **kwds: Any) -> NoReturn:
            raise

    return Quiet([f"fissix.fixes.fix_{each}" for each in _FIXERS])
