"""Reads YAML that people write: values on the command line and files of parameters."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from messages.errors import BadInput

if TYPE_CHECKING:
    import yaml


def read_yaml(text: str, where: str = "") -> Any:
    """One YAML or JSON value. ``1e-3`` is a number, as everywhere but in YAML 1.1, and no key may be given twice.

    Args:
        text: The value.
        where: The file it is from, for errors; by default they quote the text.

    Raises:
        BadInput: The text is not YAML; it says where.
    """
    import yaml

    try:
        return yaml.load(text, _loader())
    except (yaml.YAMLError, RecursionError, TypeError, ValueError) as error:
        why = " ".join(str(error).split())[:300]
        raise BadInput(f"{where}: {why}" if where else f"{text[:80]!r} is not YAML: {why}") from None


@cache
def _loader() -> type[yaml.SafeLoader]:
    import yaml

    class Loader(yaml.SafeLoader):
        """As ``yaml.SafeLoader``, with the numbers of JSON; refuses a key that is given twice."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
            keys = [self.construct_object(key, deep=True) for key, _ in node.value]
            for index, key in enumerate(keys):
                if key in keys[:index]:
                    line = node.value[index][0].start_mark.line + 1
                    raise yaml.YAMLError(f"line {line}: {key} is given twice")
            return super().construct_mapping(node, deep)

    Loader.add_implicit_resolver(
        "tag:yaml.org,2002:float", re.compile(r"[-+]?\d+(?:\.\d*)?[eE][-+]?\d+$"), list("-+0123456789")
    )
    return Loader
