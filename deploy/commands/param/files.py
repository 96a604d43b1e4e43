"""Files of parameters, YAML or TOML: a table of values for each set."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from messages.parameters import Value
from services.runtime.errors import BadInput

Format = Literal["yaml", "toml"]
LARGEST = 8 << 20
"""Bytes of a file that is read."""


def format_of(file: str, stated: str | None) -> Format:
    """The stated format, else by the file's ending, else YAML; raises BadInput for another ending."""
    if stated is not None:
        return "toml" if stated == "toml" else "yaml"
    ending = Path(file).suffix.lower()
    if ending in (".yaml", ".yml", ""):
        return "yaml"
    if ending == ".toml":
        return "toml"
    raise BadInput(f"{file}: is it YAML or TOML? Say --format yaml or --format toml")


def read_file(path: Path, form: Format) -> dict[str, Any]:
    """The tables of a file; raises BadInput with the place of what is wrong."""
    try:
        if path.stat().st_size > LARGEST:
            raise BadInput(f"{path}: larger than {LARGEST >> 20} MiB, which no file of parameters is")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise BadInput(f"{path} is not UTF-8 text: {error}") from None
    if form == "yaml":
        return read_yaml(text, str(path))
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path}: {error}") from None


def read_yaml(text: str, where: str) -> dict[str, Any]:
    """A YAML map; a key that is given twice is an error. Raises BadInput with line and column."""
    import yaml

    class Loader(yaml.SafeLoader):
        """Refuses a key that is given twice."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
            keys = [self.construct_object(key, deep=True) for key, _ in node.value]
            for index, key in enumerate(keys):
                if key in keys[:index]:
                    mark = node.value[index][0].start_mark
                    raise BadInput(f"{where}: line {mark.line + 1}: {key} is given twice")
            return super().construct_mapping(node, deep)

    try:
        table = yaml.load(text, Loader)
    except yaml.YAMLError as error:
        raise BadInput(f"{where}: {error}") from None
    except (RecursionError, TypeError, ValueError) as error:
        raise BadInput(f"{where}: it cannot be read as YAML: {error}") from None
    if table is None:
        return {}
    if not isinstance(table, dict) or not all(isinstance(key, str) for key in table):
        raise BadInput(f"{where}: expected a map of names, got {text.strip()[:60]!r}")
    return table


def read_yaml_value(text: str) -> Any:
    """Any YAML value; a text that is none stays a text."""
    import yaml

    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError):
        return text


def write_tables(tables: Mapping[str, Mapping[str, Value]], form: Format) -> str:
    """The tables as text. TOML has no null: leave such values out before."""
    plain = {name: {key: _plain(value) for key, value in table.items()} for name, table in tables.items()}
    if form == "toml":
        import tomli_w

        return tomli_w.dumps(plain)
    import yaml

    return yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, default_flow_style=None)


def _plain(value: Value) -> Any:
    return [_plain(each) for each in value] if isinstance(value, tuple) else value
