"""The values of ``<param>`` and ``<rosparam>``: typed text, files, YAML, and the output of xacro."""

from __future__ import annotations

import base64
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deploy.launch.substitution import python_value, truth
from models.input_file import read_limited
from models.xacro_file import expand_xacro
from services.runtime.errors import BadInput, unknown_name

if TYPE_CHECKING:
    import yaml

MAX_FILE = 8 << 20
"""Maximum size [bytes] of a file of parameters or text."""
TYPES = ("str", "string", "int", "double", "float", "bool", "boolean", "yaml", "auto")


@dataclass(frozen=True)
class Description:
    """A robot description in a file: a URDF, or a xacro with arguments, which is expanded when needed."""

    file: Path
    arguments: tuple[tuple[str, str], ...] = ()

    def text(self, packages: Sequence[Path]) -> str:
        """Return the URDF; raises BadInput."""
        return _expanded(self.file, self.arguments, tuple(packages))


@cache
def _expanded(file: Path, arguments: tuple[tuple[str, str], ...], packages: tuple[Path, ...]) -> str:
    text = read_text(file)
    return expand_xacro(file, dict(arguments), packages) if file.suffix == ".xacro" or "<xacro:" in text else text


def convert_value(text: str, kind: str, where: str) -> Any:
    """Convert text to a type; raises BadInput."""
    try:
        match kind:
            case "auto":
                return python_value(text)
            case "str" | "string":
                return text
            case "int":
                return int(text)
            case "double" | "float":
                return float(text)
            case "bool" | "boolean":
                return truth(text, where, "value")
            case "yaml":
                return read_parameters(text, where)
    except ValueError:
        raise BadInput(f"{where}: {text[:80]!r} is not a valid {kind}") from None
    raise unknown_name("type", kind, TYPES, where)


def read_text(path: Path) -> str:
    """Return the text of a file; raises BadInput."""
    return read_limited(path, MAX_FILE, "parameters").decode("utf-8", "replace")


def read_parameters(text: str, where: str) -> Any:
    """Parse YAML as ``rosparam load`` does, including ``deg(90)``, ``rad(pi/2)``, ``!degrees 90`` and ``!!binary``.

    Raises BadInput; ``where`` is a file, to which the line is added, or a place.
    """
    import yaml

    try:
        return plain(yaml.load(text, _loader()), where)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        raise BadInput(f"{where}: YAML, line {mark.line + 1 if mark else '?'}: {error.problem}") from None
    except (yaml.YAMLError, RecursionError, TypeError, ValueError, OverflowError) as error:
        raise BadInput(f"{where}: this is not YAML: {' '.join(str(error).split())[:200]}") from None


def plain(value: Any, where: str) -> Any:
    """Convert a YAML value to a parameter: keys and dates become text, bytes base64 text, None an empty text."""
    if isinstance(value, dict):
        return {str(key): plain(each, where) for key, each in value.items() if each is not None}
    if isinstance(value, list | tuple | set):
        return [plain(each, where) for each in value]
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if value is None:
        return ""
    return value if isinstance(value, bool | int | float | str) else str(value)


def command_output(command: str, where: str) -> str | Description:
    """Return the output of a known ``command``: xacro, ``cat`` or ``rosversion``. No other is run."""
    try:
        program, *words = shlex.split(command.replace("\n", " "))
    except ValueError as error:
        raise BadInput(f"{where}: the command cannot be read: {error}: {command[:120]!r}") from None
    name = program.rpartition("/")[2]
    if name in ("xacro", "xacro.py"):
        files = [each for each in words if ":=" not in each and not each.startswith("-")]
        if len(files) != 1:
            raise BadInput(f"{where}: xacro needs one file: {command[:200]!r}")
        pairs = [each.partition(":=") for each in words if ":=" in each]
        return Description(Path(files[0]), tuple((key, value) for key, _, value in pairs))
    if name == "cat" and len(words) == 1:
        file = Path(words[0])
        return Description(file) if file.suffix in (".urdf", ".xacro") else read_text(file)
    if name == "rosversion":
        return "noetic\n"
    raise BadInput(
        f"{where}: the command {program[:80]!r} is not run: only xacro, cat and rosversion are supported; "
        "write its output to a file, and use textfile"
    )


def description_of(text: str) -> str:
    """Return the robot's name in the text of a URDF or SDF; "" if it has none."""
    found = re.search(r"<(?:robot|model)\b[^>]*\bname\s*=\s*(['\"])([^'\"]*)\1", text)
    return found[2] if found else ""


@cache
def _loader() -> type[yaml.SafeLoader]:
    import yaml

    class Loader(yaml.SafeLoader):
        """``yaml.SafeLoader`` with rosparam's angles."""

    def angle(loader: yaml.SafeLoader, node: yaml.Node) -> float:
        text = str(node.value).strip()
        degrees = node.tag == "!degrees" or text.startswith("deg")
        inner = text[4:-1] if text.startswith(("deg(", "rad(")) else text
        value = _number(inner)
        return math.radians(value) if degrees else value

    Loader.add_constructor("!degrees", angle)
    Loader.add_constructor("!radians", angle)
    Loader.add_implicit_resolver("!degrees", re.compile(r"^deg\([^()]*\)$"), ["d"])
    Loader.add_implicit_resolver("!radians", re.compile(r"^rad\([^()]*\)$"), ["r"])
    return Loader


def _number(text: str) -> float:
    """Evaluate a sum or product of numbers and pi, e.g. ``pi/2``."""
    if not re.fullmatch(r"[\d\s.+\-*/()eEpi]*", text):
        raise ValueError(f"{text[:40]!r} is not an angle")
    names: Mapping[str, Any] = {"__builtins__": {}, "pi": math.pi}
    try:
        return float(eval(compile(text.strip(), "<angle>", "eval"), dict(names)))
    except (SyntaxError, NameError, ArithmeticError, TypeError) as error:
        raise ValueError(f"{text[:40]!r} is not an angle: {error}") from None
