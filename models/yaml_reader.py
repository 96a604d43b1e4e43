"""Reads YAML: values on the command line, files of parameters and controllers, and the metadata of bags."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from messages.errors import BadInput

if TYPE_CHECKING:
    import yaml


def read_yaml(text: str, where: str = "") -> Any:
    """Parse one YAML or JSON value. ``1e-3`` is a number, unlike in YAML 1.1, and duplicate keys are refused.

    It uses PyYAML's pure Python parser. The one in C is five times as fast (0.06 s, not 0.3 s, for the metadata of a
    bag with 1,000 topics), but crashes the process on a text that is nested a million levels deep.

    Args:
        text: The value.
        where: Its file, for errors; by default they quote the text.

    Raises:
        BadInput: The text is not YAML; the error says where.
    """
    import yaml

    try:
        return yaml.load(text, _loader())
    except (yaml.YAMLError, RecursionError, TypeError, ValueError, OverflowError) as error:
        why = " ".join(str(error).split())[:300]
        raise BadInput(f"{where}: {why}" if where else f"{text[:80]!r} is not YAML: {why}") from None


@cache
def _loader() -> type[yaml.SafeLoader]:
    import yaml

    class Loader(yaml.SafeLoader):
        """Like ``yaml.SafeLoader``, with JSON's number syntax; refuses duplicate keys."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
            seen = set()
            for given, _ in node.value:
                key = self.construct_object(given, deep=True)
                if key in seen:
                    raise yaml.YAMLError(f"line {given.start_mark.line + 1}: {key} is given twice")
                seen.add(key)
            return super().construct_mapping(node, deep)

    Loader.add_implicit_resolver(
        "tag:yaml.org,2002:float", re.compile(r"[-+]?\d+(?:\.\d*)?[eE][-+]?\d+$"), list("-+0123456789")
    )
    return Loader


class YamlSource:
    """A YAML text and the name of its file, for errors with the line of a key, as ``TomlSource`` for TOML."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self._text = path, text

    def location(self, *keys: str | int) -> str:
        """Return ``file:line`` of the key at ``keys`` in a valid text, or of the nearest enclosing key.

        Nested keys may be written as one with dots, as in ROS 2.
        """
        import yaml

        node, line, rest = yaml.compose(self._text, _loader()), 0, list(map(str, keys))
        while rest:
            entries: dict[str, tuple[Any, Any]] = {}
            if isinstance(node, yaml.MappingNode):
                entries = {str(name.value): (name, value) for name, value in node.value}
            elif isinstance(node, yaml.SequenceNode):
                entries = {str(index): (value, value) for index, value in enumerate(node.value)}
            found = next((n for n in range(1, len(rest) + 1) if ".".join(rest[:n]) in entries), None)
            if found is None:
                break
            at, node = entries[".".join(rest[:found])]
            line, rest = at.start_mark.line, rest[found:]
        return f"{self.path}:{line + 1}"
