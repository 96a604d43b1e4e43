"""All errors of the project are in one tree, and its diagram in services/runtime/errors.py is complete."""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator

from services.runtime import errors
from services.runtime.process import ROOT

BUILT_IN = {name for name, each in vars(builtins).items() if isinstance(each, type) and issubclass(each, BaseException)}
NOT_ERRORS = {"ServiceCaptured"}
"""Classes that must not be caught by any error handler."""

CLASS = re.compile(r"^\s*class \w", re.MULTILINE)
"""A class statement: files without one are not parsed."""


def classes() -> dict[str, tuple[list[str], str]]:
    """Return the bases and module of every class of the product, except in imitations of foreign libraries."""
    found = {}
    for package in ("deploy", "services", "messages", "models"):
        for file in sorted((ROOT / package).rglob("*.py")):
            if "site-packages" in file.parts:  # imitates the exceptions of other libraries
                continue
            module = ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
            text = file.read_text()
            for node in _statements(ast.parse(text)) if CLASS.search(text) else ():
                if isinstance(node, ast.ClassDef):
                    found[node.name] = [ast.unparse(each).rpartition(".")[2] for each in node.bases], module
    return found


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements below a node; unlike ``ast.walk``, no expressions."""
    for field in ("body", "orelse", "handlers", "finalbody", "cases"):
        for each in getattr(node, field, ()):
            yield each
            yield from _statements(each)


def drawn() -> Iterator[tuple[str, str, str]]:
    """Yield name, parent and module of each line of the diagram."""
    path = ["EleaError"]
    for line in (errors.__doc__ or "").splitlines():
        if found := re.fullmatch(r"((?:│   |    )*)[├└]── (\w+)(?: \(\w+\))? +(.*)", line):
            indent, name, text = found.groups()
            depth = len(indent) // 4 + 1
            path[depth:] = [name]
            module = re.match(r"([a-z_.]+): ", text)
            yield name, path[depth - 1], module[1] if module else errors.__name__


def test_every_error_is_in_the_tree_and_drawn() -> None:
    known = classes()

    def ancestors(name: str) -> set[str]:
        bases = [each for each in known[name][0] if each != name] if name in known else []
        return {*bases, *(each for base in bases for each in ancestors(base))}

    raised = {name for name in known if ancestors(name) & BUILT_IN} - NOT_ERRORS - {"EleaError"}
    assert {name for name in raised if "EleaError" not in ancestors(name)} == set()
    assert "BadInput" in raised
    shown = {name: (known[name][0][0], known[name][1].replace("messages.errors", errors.__name__)) for name in raised}
    assert {name: (parent, module) for name, parent, module in drawn()} == shown
