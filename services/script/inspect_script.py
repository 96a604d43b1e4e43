"""Determines from the text of a Python file whether it is a ROS program, for which ROS, and its node's name.

Nothing in the file is executed. Python 2 files that do not parse are searched line by line.
"""

from __future__ import annotations

import ast
import re
import tokenize
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from messages.errors import BadInput, missing_file
from messages.names import LONGEST_NODE
from services.script.workspace import workspace_of

Api = Literal["ros1", "ros2", ""]

ROS1_MODULES = frozenset(
    [
        *("rospy", "roslib", "rospkg", "rosgraph", "rosparam", "rosnode", "rostopic", "rosservice", "rosbag", "genpy"),
        *("actionlib", "cv_bridge", "dynamic_reconfigure", "message_filters", "tf", "tf_conversions"),
    ]
)
"""Modules that make a file that imports them a ROS 1 program; ``tf2_ros`` and message packages exist in both."""
ROS2_MODULES = frozenset(["ament_index_python", "launch", "launch_ros", "rclpy", "tf_transformations"])
OWN_MODULES = frozenset(["services"])
"""Modules that make a file that imports them a service of Elea, whatever else it imports."""

MAX_SCRIPT = 8 << 20
"""Maximum size of a script [bytes]."""
MAX_IMPORTED = 40
"""Maximum number of files next to a script that are inspected for its ROS version."""

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import\b|import[ \t]+([\w., \t]+))", re.MULTILINE)
_INIT_NODE = re.compile(r"\binit_node\s*\(\s*[urUR]{0,2}(['\"])([^'\"\n]*)\1")


@dataclass(frozen=True)
class ScriptFacts:
    """The properties of a file: ``api`` is "" if it does not use ROS.

    ``node_name`` is legal, and empty if none is stated; ``anonymous`` nodes get a unique name each time.
    """

    api: Api
    node_name: str = ""
    anonymous: bool = False


def inspect_script(path: Path) -> ScriptFacts:
    """Inspect a Python file and the modules next to it; raises BadInput."""
    text = read_script(path)
    tree = _parse(text)
    name, anonymous = _node_in_tree(tree) if tree is not None else _node_in_text(text)
    return ScriptFacts(_api(path, text, tree), legal_node_name(name), anonymous)


def is_python(path: Path) -> bool:
    """Return whether a file is Python, by its name or first line."""
    if path.suffix == ".py":
        return True
    try:
        with path.open("rb") as file:
            first = file.readline(200)
    except OSError:
        return False
    return first.startswith(b"#!") and b"python" in first


def read_script(path: Path) -> str:
    """Return the text of a script in its own encoding, with invalid bytes replaced. Raises BadInput."""
    try:
        if path.is_dir() or not path.exists():
            raise missing_file(path)
        if path.stat().st_size > MAX_SCRIPT:
            raise BadInput(f"{path} is larger than {MAX_SCRIPT >> 20} MB: is it a script?")
        raw = path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path} cannot be read: {error.strerror}") from None
    try:
        encoding, _ = tokenize.detect_encoding(iter(raw.splitlines(keepends=True)).__next__)
    except SyntaxError:
        encoding = "utf-8"
    return raw.decode(encoding, "replace")


def runs_nothing(path: Path) -> bool:
    """Return whether a file uses Elea but only contains definitions, so that running it does
    nothing. Raises BadInput.
    """
    text = read_script(path)
    tree = _parse(text)
    if tree is None or not {each.partition(".")[0] for each in _imports(text, tree)} & OWN_MODULES:
        return False
    return all(map(_only_defines, tree.body))


def _only_defines(statement: ast.stmt) -> bool:
    match statement:
        case ast.Import() | ast.ImportFrom() | ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            return True
        case ast.Assign() | ast.AnnAssign():
            calls = (each.func for each in ast.walk(statement) if isinstance(each, ast.Call))
            return not any("main" in ast.unparse(each) for each in calls)
        case ast.Expr(value=ast.Constant()):  # a docstring
            return True
        case _:
            return False


def legal_node_name(name: str) -> str:
    """Return a name with every character replaced that is illegal for a node; empty for an empty one."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", name.strip().rpartition("/")[2])[:LONGEST_NODE]
    return f"_{name}" if name[:1].isdigit() else name


def imported_modules(text: str) -> set[str]:
    """Return the dotted names of the modules that a text imports, including those in functions."""
    return _imports(text, _parse(text))


def _parse(text: str) -> ast.Module | None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        return None


def _imports(text: str, tree: ast.Module | None) -> set[str]:
    if tree is None:
        found = (match for match in _IMPORT.findall(text))
        return {
            name.split()[0] for origin, plain in found for name in (origin or plain).split(",") if name.strip(" \t.")
        }
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
            names |= {f"{node.module}.{each.name}" for each in node.names}
    return names


def _api(path: Path, text: str, tree: ast.Module | None) -> Api:
    """Return the ROS version by the file's imports; without any, by those of modules in its folder or package.

    A program in a ROS package is a ROS 1 program without such imports as well, since a launch file can start it.
    """
    pending, seen = [(path, _imports(text, tree))], {path}
    while pending:
        here, names = pending.pop(0)
        roots = {each.partition(".")[0] for each in names}
        if roots & OWN_MODULES:
            return ""
        if roots & ROS2_MODULES:
            return "ros2"
        if roots & ROS1_MODULES:
            return "ros1"
        for file in _local_modules(here, names):
            if file not in seen and len(seen) < MAX_IMPORTED:
                seen.add(file)
                try:
                    pending.append((file, imported_modules(read_script(file))))
                except BadInput:
                    continue
    return "ros1" if workspace_of(path, {}).own is not None else ""


def _local_modules(path: Path, names: set[str]) -> Iterator[Path]:
    folders = [path.parent, path.parent.parent / "src", path.parent.parent.parent / "src"]
    for name in sorted(names):
        inner = Path(*name.split("."))
        for folder in folders:
            for file in (folder / inner.with_suffix(".py"), folder / inner / "__init__.py"):
                if file.is_file():
                    yield file


def _node_in_tree(tree: ast.Module) -> tuple[str, bool]:
    """Return the name in the first call of ``init_node``, and whether it is anonymous; "" if it is computed."""
    constants = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }

    def value(node: ast.expr | None) -> object:
        if isinstance(node, ast.Name):
            return constants.get(node.id)
        return node.value if isinstance(node, ast.Constant) else None

    calls = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and (node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")) == "init_node"
    ]
    for call in sorted(calls, key=lambda each: each.lineno):
        keywords = {each.arg: each.value for each in call.keywords}
        name = value(call.args[0] if call.args else keywords.get("name"))
        anonymous = value(call.args[2] if len(call.args) > 2 else keywords.get("anonymous"))
        return (name if isinstance(name, str) else ""), bool(anonymous)
    return "", False


def _node_in_text(text: str) -> tuple[str, bool]:
    found = _INIT_NODE.search(text)
    if found is None:
        return "", False
    line = text[found.end() :].partition("\n")[0]
    return found[2], bool(re.search(r"anonymous\s*=\s*(True|1)\b", line))
