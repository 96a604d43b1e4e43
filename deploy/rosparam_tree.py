"""A tree of ROS 1 parameters as nested dicts: build, merge, look up."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from services.runtime.errors import BadInput

Tree = dict[str, Any]


def parameter_tree(table: Mapping[str, Any], where: str) -> Tree:
    """Convert a nested table to a tree: a key ``a/b`` is ``b`` in ``a``. Raises BadInput with the place ``where``."""
    tree: Tree = {}
    for key, value in table.items():
        if not key.strip("/"):
            raise BadInput(f"{where}: {key!r} is not a valid parameter name")
        inner = parameter_tree(value, where) if isinstance(value, dict) else _checked(value, key, where)
        set_parameter(tree, key, inner)
    return tree


def set_parameter(tree: Tree, key: str, value: Any) -> None:
    """Set a value or, with a dict, merge a branch into the tree; conflicting values are replaced."""
    *above, last = [part for part in key.split("/") if part] or [""]
    for part in above:
        inner = tree.get(part)
        if not isinstance(inner, dict):
            inner = tree[part] = {}
        tree = inner
    if not last:
        for name, each in value.items():
            set_parameter(tree, name, each)
    elif isinstance(value, dict) and isinstance(tree.get(last), dict):
        for name, each in value.items():
            set_parameter(tree[last], name, each)
    else:
        tree[last] = value


def get_parameter(tree: Tree, key: str) -> Any:
    """Return the value or branch of a key; raises KeyError."""
    found: Any = tree
    for part in filter(None, key.split("/")):
        if not isinstance(found, dict):
            raise KeyError(key)
        found = found[part]
    return found


def leaves(tree: Tree, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a tree by absolute name."""
    for name, value in tree.items():
        key = f"{above}/{name}"
        if isinstance(value, dict) and value:
            yield from leaves(value, key)
        else:
            yield key, value


def _checked(value: Any, key: str, where: str) -> Any:
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list):
        return [parameter_tree(each, where) if isinstance(each, dict) else _checked(each, key, where) for each in value]
    raise BadInput(f"{where}: {key}: a parameter is text, a number, true or false, a list or a table, not {value!r}")
