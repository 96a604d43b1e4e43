"""The source of a script's own modules: read, converted if it is Python 2, and compiled with counted loops."""

from __future__ import annotations

import ast
import sys
import warnings
from pathlib import Path
from types import CodeType
from typing import Any

from services.script import python2
from services.script.inspect_script import read_script
from services.script.python2_input import computes_with_input

PASS = "__elea_pass__"
"""The builtin called at the head of each loop."""
DIVIDE = "__elea_divide__"
"""The builtin that divides as in Python 2: two ints give an int."""
TOSTRING = "__elea_tostring__"
"""The builtin that calls an object's ``tostring``, which numpy's arrays no longer have."""
_ENDLESS = frozenset({"count", "cycle", "repeat", "iter"})


def compile_script(path: Path) -> CodeType:
    """Compile a file; raises SyntaxError with the file's own line, BadInput if it cannot be read."""
    tree, old = parse_script(path)
    tree = ast.fix_missing_locations(_Loops(old).visit(tree))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        return compile(tree, str(path), "exec", dont_inherit=True)


def parse_script(path: Path) -> tuple[ast.Module, bool]:
    """Return the syntax tree of a file, and whether it was converted from Python 2, which is reported on stderr."""
    source = read_script(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            tree = ast.parse(source, str(path))
        except TabError:
            try:
                tree = ast.parse(python2.expand_tabs(source), str(path))
            except SyntaxError:
                return _converted(source, path, None), True
            if python2.looks_like_python2(source):
                return _converted(source, path, None), True
            _note(path, "tabs mixed with spaces are taken as 8 columns")
            return tree, False
        except SyntaxError as error:
            return _converted(source, path, error), True
        except (ValueError, RecursionError, MemoryError) as error:
            raise SyntaxError(f"cannot be parsed: {error}", (str(path), 1, 0, "")) from None
        if _has_late_globals(tree, path):
            return _converted(source, path, None), True
        if not python2.looks_like_python2(source) and not ("input(" in source and computes_with_input(tree, source)):
            return tree, False
        try:
            return _converted(source, path, None), True
        except SyntaxError:
            return tree, False


def _converted(source: str, path: Path, error: SyntaxError | None) -> ast.Module:
    """Return the tree of a Python 2 text; raises ``error``, that of Python 3, if it is not Python 2 either."""
    try:
        tree = ast.parse(python2.convert(source, str(path)), str(path))
    except SyntaxError as other:
        raise _later(error, other, path) from None
    except (ValueError, RecursionError) as other:
        raise _later(error, SyntaxError(str(other)), path) from None
    _EarlyGlobals().visit(tree)
    ast.fix_missing_locations(tree)
    _note(path, "is Python 2: converted as it is loaded, the file stays as it is")
    return tree


def _has_late_globals(tree: ast.Module, path: Path) -> bool:
    """Return whether a name is used before its ``global``, for which Python 2 only warned."""
    if not any(isinstance(each, ast.Global) for each in ast.walk(tree)):
        return False
    try:
        compile(tree, str(path), "exec", dont_inherit=True)
    except SyntaxError as error:
        return "global declaration" in error.msg
    return False


class _EarlyGlobals(ast.NodeTransformer):
    """Moves ``global`` to the head of its function, and drops it at module level, where it has no effect."""

    def __init__(self) -> None:
        self._found: list[ast.Global] = []

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        outer, self._found = self._found, []
        self.generic_visit(node)
        body = node.body
        after_text = isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant)
        body[after_text:after_text] = self._found
        self._found = outer
        return node

    def visit_Global(self, node: ast.Global) -> ast.AST:
        self._found.append(node)
        return ast.copy_location(ast.Pass(), node)


def _later(error: SyntaxError | None, other: SyntaxError, path: Path) -> SyntaxError:
    """Return the error at the later line: the other Python version did not understand what precedes it."""
    found = other if error is None or (other.lineno or 0) > (error.lineno or 0) else error
    if found.lineno is None:
        return SyntaxError(found.msg, (str(path), 1, 0, ""))
    return found


def _note(path: Path, text: str) -> None:
    sys.stderr.write(f"{path.name}: {text}\n")


class _Loops(ast.NodeTransformer):
    """Inserts a call at the head of each loop that may not end; replaces ``x.tostring()``, and in Python 2 division."""

    def __init__(self, old: bool) -> None:
        self._old = old

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST:
        if node.module == "__future__" and any(each.name == "division" for each in node.names):
            self._old = False
        return node

    def visit_While(self, node: ast.While) -> ast.AST:
        self.generic_visit(node)
        node.body.insert(0, _point(node.body[0]))
        return node

    def visit_For(self, node: ast.For) -> ast.AST:
        self.generic_visit(node)
        call = node.iter
        if isinstance(call, ast.Call):
            function = call.func
            name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
            if name in _ENDLESS:
                node.body.insert(0, _point(node.body[0]))
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        match node:
            case ast.Call(ast.Attribute(value, "tostring"), [], []):
                made = ast.copy_location(ast.Call(ast.Name(TOSTRING, ast.Load()), [value], []), node)
                last, end = node.func.end_lineno, node.func.end_col_offset
                if last is not None and end is not None and last != node.lineno:  # Python's line of a method call
                    made.lineno, made.col_offset = last, end - len("tostring")
                return made
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if self._old and isinstance(node.op, ast.Div):
            return ast.copy_location(_divided(node.left, node.right), node)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        self.generic_visit(node)
        if not self._old or not isinstance(node.op, ast.Div):
            return node
        match target := node.target:
            case ast.Name(name):
                current: ast.expr = ast.Name(name, ast.Load())
            case ast.Attribute(ast.Name(name), attribute):  # to read a name twice has no side effects
                current = ast.Attribute(ast.Name(name, ast.Load()), attribute, ast.Load())
            case _:
                return node
        return ast.copy_location(ast.Assign([target], _divided(current, node.value)), node)


def divide(one: Any, two: Any) -> Any:
    """Return ``one / two`` as in Python 2."""
    return one // two if isinstance(one, int) and isinstance(two, int) else one / two


def _divided(left: ast.expr, right: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(DIVIDE, ast.Load()), [left, right], [])


def _point(before: ast.stmt) -> ast.stmt:
    call = ast.Expr(ast.Call(ast.Name(PASS, ast.Load()), [], []))
    return ast.copy_location(call, before)
