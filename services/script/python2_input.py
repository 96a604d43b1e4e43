"""Recognizes Python 2 programs that Python 3 can parse by their use of ``input()``, which evaluated the typed text.

A Python 3 program converts the text. One that computes with it directly would only raise TypeError there.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

_CONVERTERS = frozenset(["bool", "eval", "float", "int", "len", "str"])
_OF_NUMBERS = frozenset(
    ["abs", "atan2", "cos", "fabs", "hypot", "pow", "radians", "range", "round", "sin", "sqrt", "tan", "xrange"]
)
_FIELDS = frozenset(["x", "y", "z", "w", "theta"])
"""Numeric fields of messages."""
_ORDERS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)


def computes_with_input(tree: ast.Module, source: str) -> bool:
    """Return whether a program uses the result of ``input()`` as a number without converting it."""
    if "python3" in source.partition("\n")[0]:
        return False
    functions = {each.name: each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef)}
    pending = list(_answers(tree))
    seen: set[tuple[int, str]] = set()
    numbers = False
    while pending:
        scope, name = pending.pop()
        if (id(scope), name) in seen:
            continue
        seen.add((id(scope), name))
        numbers = numbers or ("." in name.removeprefix("self.") and name.rpartition(".")[2] in _FIELDS)
        for node in ast.walk(scope):
            match _use(node, name):
                case "text":
                    return False
                case "number":
                    numbers = True
            pending += _passed_on(node, name, functions)
    return numbers


def _answers(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Yield the names assigned from ``input()``, with the function or class that may use them."""
    scopes: list[ast.AST] = [tree, *(each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef))]
    for scope in scopes:
        for node in ast.walk(scope):
            if isinstance(node, ast.Assign) and _is_call(node.value, frozenset(["input"])):
                for target in node.targets:
                    name = ast.unparse(target)
                    yield (tree if name.startswith("self.") else scope), name


def _use(node: ast.AST, name: str) -> str:
    """Return the type that a use of a name implies: "number", "text", or "" for neither."""
    match node:
        case ast.Call(func=ast.Attribute(value=value)) if _is(value, name):
            return "text"
        case ast.Subscript(value=value) if _is(value, name):
            return "text"
        case ast.Call(args=arguments) if any(_is(each, name) for each in arguments):
            if _is_call(node, _CONVERTERS):
                return "text"
            return "number" if _is_call(node, _OF_NUMBERS) else ""
        case ast.BinOp(left=left, right=right, op=ast.Sub() | ast.Div() | ast.FloorDiv() | ast.Pow()):
            return "number" if _is_product(left, name) or _is_product(right, name) else ""
        case ast.BinOp(left=left, right=right, op=ast.Mult() | ast.Add()):
            other = right if _is_product(left, name) else left if _is_product(right, name) else None
            is_int_or_text = isinstance(other, ast.Constant) and isinstance(other.value, int | str)
            added = isinstance(node.op, ast.Add) and not (isinstance(other, ast.Constant) and not is_int_or_text)
            return "number" if other is not None and not is_int_or_text and not added else ""
        case ast.Compare(left=left, comparators=others, ops=operators):
            sides = [left, *others]
            if not any(_is(each, name) for each in sides):
                return ""
            constants = [each.value for each in sides if isinstance(each, ast.Constant)]
            if any(isinstance(each, str) for each in constants):
                return "text"
            ordered = any(isinstance(each, _ORDERS) for each in operators)
            return "number" if ordered or any(type(each) in (int, float) for each in constants) else ""
        case ast.Assign(value=value, targets=[ast.Attribute(attr=field)]) if _is(value, name):
            return "number" if field in _FIELDS else ""
    return ""


def _passed_on(
    node: ast.AST, name: str, functions: dict[str, ast.FunctionDef]
) -> Iterator[tuple[ast.FunctionDef, str]]:
    """Yield the parameters of the program's own functions to which it is passed."""
    if not isinstance(node, ast.Call):
        return
    called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if (function := functions.get(called)) is None:
        return
    names = [each.arg for each in function.args.args]
    names = names[1:] if names[:1] == ["self"] else names
    for given, own in zip(node.args, names, strict=False):
        if _is(given, name):
            yield function, own


def _is(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node) == name


def _is_product(node: ast.AST, name: str) -> bool:
    """Return whether an operand is the name, or a product with it."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        return _is_product(node.left, name) or _is_product(node.right, name)
    return _is(node, name)


def _is_call(node: ast.AST, names: frozenset[str]) -> bool:
    if not isinstance(node, ast.Call):
        return False
    called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    return called in names
