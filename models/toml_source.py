"""Line numbers of keys in a TOML text, for errors about their values."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

TomlKey = str | int
"""A key, or the index of an array element."""


class TomlSource:
    """A TOML text and the name of its file.

    ``set_elsewhere`` are keys whose values do not come from the file, each with a text that replaces its line.
    """

    def __init__(self, path: Path, text: str, set_elsewhere: Sequence[tuple[tuple[TomlKey, ...], str]] = ()) -> None:
        self.path, self._text, self._set_elsewhere = path, text, set_elsewhere
        self._written: Callable[[tuple[TomlKey, ...]], tuple[TomlKey, ...]] | None = None

    def with_written(self, written: Callable[[tuple[TomlKey, ...]], tuple[TomlKey, ...]]) -> Self:
        """Return the same text with derived keys: ``written`` maps a key to the one in the text."""
        made = type(self)(self.path, self._text, self._set_elsewhere)
        made._written = written
        return made

    def location(self, *path: TomlKey) -> str:
        """Return ``file:line`` of the key at ``path``, or of the nearest enclosing table; or where else it was set."""
        if self._written is not None:
            path = self._written(path)
        for own, where in reversed(self._set_elsewhere):
            if path[: len(own)] == own:
                return where
        return f"{self.path}:{line_of(self._text, path)}"


def key_path(text: str) -> tuple[TomlKey, ...]:
    """Parse the path at the end of msgspec's errors, ``.robot[2].pose.x``, up to the first unnamed key."""
    steps: list[TomlKey] = []
    for name, index, rest in re.findall(r"\.(\w+)|\[(\d+)\]|(\[\.\.\.\])", text):
        if rest:
            break
        steps.append(name or int(index))
    return tuple(steps)


def line_of(text: str, path: Sequence[TomlKey]) -> int:
    """Return the line, from 1, of the key at ``path`` in a valid TOML text; if it does not exist, of its nearest
    existing part.

    A table of an array is given by its index: ``("robot", 2, "pose", "x")``.
    """
    best, line = 0, 1
    first = tuple(path[:1])
    for number, chunk, keys in _statements(text):
        if keys[:1] != first:
            continue
        shared = _common_prefix(keys, path)
        if shared == len(keys) and shared > best:
            best, line = shared, number + _inline_offset(chunk, path[shared:])
        elif shared == len(path) and shared > best:
            best, line = shared, number
    return line


@lru_cache(1)
def _statements(text: str) -> tuple[tuple[int, str, tuple[TomlKey, ...]], ...]:
    """Line, text and path of each statement: the shortest sequence of lines that is valid TOML.

    Cached, since it is needed for each robot of a file: with 300 robots, parsing each time took minutes.
    """
    found = []
    here: tuple[TomlKey, ...] = ()
    counts: dict[tuple[TomlKey, ...], int] = {}
    for number, chunk, parsed in _split(text):
        if chunk.lstrip().startswith("["):
            keys = here = _header(parsed, counts)
        else:
            keys = here + tuple(_keys(parsed))
        found.append((number, chunk, keys))
    return tuple(found)


def _split(text: str) -> Iterator[tuple[int, str, dict[str, Any]]]:
    lines = text.splitlines()
    start = 0
    while start < len(lines):
        for end in range(start + 1, len(lines) + 1):
            chunk = "\n".join(lines[start:end])
            try:
                parsed = tomllib.loads(chunk)
            except ValueError:
                continue
            if parsed:
                yield start + 1, chunk, parsed
            break
        start = end


def _header(parsed: dict[str, Any], counts: dict[tuple[TomlKey, ...], int]) -> tuple[TomlKey, ...]:
    """Return the path of ``[a.b]`` or ``[[a.b]]``, with the indices of its arrays."""
    path: tuple[TomlKey, ...] = ()
    value: Any = parsed
    while value:
        if isinstance(value, list):
            counts[path] = counts.get(path, -1) + 1
            path, value = (*path, counts[path]), value[0]
            continue
        if path in counts:
            path = (*path, counts[path])
        name = next(iter(value))
        path, value = (*path, name), value[name]
    return path


def _keys(parsed: dict[str, Any]) -> Iterator[str]:
    """Yield the keys of an assignment; dotted ones are nested tables with one entry each."""
    (name, value), *_ = parsed.items()
    yield name
    if isinstance(value, dict) and len(value) == 1:
        yield from _keys(value)


def _common_prefix(left: Sequence[TomlKey], right: Sequence[TomlKey]) -> int:
    """Return the number of equal leading parts."""
    return next((i for i, (a, b) in enumerate(zip(left, right, strict=False)) if a != b), min(len(left), len(right)))


def _inline_offset(chunk: str, rest: Sequence[TomlKey]) -> int:
    """Return the lines from the start of a statement to the innermost key of ``rest`` in its inline tables."""
    lines = chunk.splitlines()
    for name in reversed([step for step in rest if isinstance(step, str)]):
        for offset, line in enumerate(lines):
            if re.search(rf"(?<![\w-]){re.escape(name)}\b[\"']?\s*=", line):
                return offset
    return 0
