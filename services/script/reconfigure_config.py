"""Reads the ``.cfg`` files of dynamic_reconfigure: Python that describes parameters to a generator, run without a
build.

A file is executed unchanged, with the generator below in place of ROS's, and yields the names of the module that a
build would have written: ``config_description``, ``defaults``, ``min``, ``max``, ``level``, ``type`` and constants.
"""

from __future__ import annotations

import ast
import builtins
import re
import sys
import traceback
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any, ClassVar, NamedTuple

from services.runtime.errors import BadInput
from services.script import python2

STR, BOOL, INT, DOUBLE = "str", "bool", "int", "double"
_PYTHON_TYPES: dict[str, type] = {STR: str, BOOL: bool, INT: int, DOUBLE: float}
_LOWEST: dict[str, Any] = {STR: "", BOOL: False, INT: -0x80000000, DOUBLE: float("-inf")}
_HIGHEST: dict[str, Any] = {STR: "", BOOL: True, INT: 0x7FFFFFFF, DOUBLE: float("inf")}
_DEFAULTS: dict[str, Any] = {STR: "", BOOL: False, INT: 0, DOUBLE: 0.0}
_C_TYPES = {STR: "std::string", BOOL: "bool", INT: "int", DOUBLE: "double"}
_C_CONSTANTS = {STR: "const char * const", BOOL: "const bool", INT: "const int", DOUBLE: "const double"}
_NAME = re.compile(r"[a-zA-Z][a-zA-Z0-9_]*")

MAX_BYTES = 1 << 20
"""Maximum size of a ``.cfg`` file."""


class BadConfig(BadInput):
    """A ``.cfg`` file cannot be used; the text begins with its name and line."""


class Constant(NamedTuple):
    """A choice of an enum parameter: its name, its value, and its description."""

    name: str
    value: Any
    description: str


class _Generated(NamedTuple):
    name: str
    group: ParameterGroup
    constants: tuple[dict[str, Any], ...]


class ParameterGroup:
    """A group of parameters and groups: ``gen`` in a ``.cfg`` file, or the result of ``add_group``."""

    def __init__(
        self,
        generator: ParameterGenerator,
        name: str,
        kind: str,
        state: bool,
        number: int,
        parent: ParameterGroup | int | None,
    ) -> None:
        self.generator, self.name, self.type, self.state, self.id = (
            generator,
            name.replace(" ", "_"),
            kind,
            state,
            number,
        )
        self.parent = parent if isinstance(parent, ParameterGroup) else self
        self.groups: list[ParameterGroup] = []
        self.parameters: list[dict[str, Any]] = []
        self.place = generator.place()

    def add_group(self, name: str, type: str = "", state: bool = True) -> ParameterGroup:  # noqa: A002 - ROS's name
        """Add a group inside this one."""
        self.generator.groups += 1
        made = ParameterGroup(self.generator, name, type, state, self.generator.groups, self)
        self.groups.append(made)
        return made

    def add(
        self,
        name: str,
        paramtype: str,
        level: int,
        description: str,
        default: Any = None,
        min: Any = None,  # noqa: A002 - ROS's name
        max: Any = None,  # noqa: A002 - ROS's name
        edit_method: str = "",
    ) -> None:
        """Describe a parameter."""
        if not _NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not a valid parameter name: a letter, then letters, digits and underscores")
        if paramtype not in _PYTHON_TYPES:
            raise TypeError(f"{name} has the type {paramtype!r}, expected str_t, bool_t, int_t or double_t")
        if paramtype in (STR, BOOL) and (min is not None or max is not None):
            raise ValueError(f"{name} is a {paramtype}, which takes no min and max")
        if any(each["name"] == name for each in self.generator.group.get_parameters()):
            raise ValueError(f"the parameter {name} is added twice")
        lowest, highest = _bound(name, paramtype, "min", min, _LOWEST), _bound(name, paramtype, "max", max, _HIGHEST)
        if paramtype in (INT, DOUBLE) and lowest > highest:
            raise ValueError(f"{name}: min {lowest} is above max {highest}")
        self.parameters.append(
            {
                "name": name,
                "type": paramtype,
                "default": _bound(name, paramtype, "default", default, _DEFAULTS),
                "level": level,
                "description": description,
                "min": lowest,
                "max": highest,
                **self.generator.place(),
                "edit_method": edit_method,
                "ctype": _C_TYPES[paramtype],
                "cconsttype": _C_CONSTANTS[paramtype],
            }
        )

    def get_parameters(self) -> list[dict[str, Any]]:
        """Return the parameters of this group and all groups inside it."""
        return [*self.parameters, *(each for group in self.groups for each in group.get_parameters())]

    def to_dict(self) -> dict[str, Any]:
        """Return the group as in the module's ``config_description``."""
        classes = [each.upper() for each in self._path()]
        return {
            "name": self.name,
            "type": self.type,
            "state": self.state,
            "cstate": "true" if self.state else "false",
            "id": self.id,
            "parent": self.parent.id,
            "parameters": self.parameters,
            "groups": [each.to_dict() for each in self.groups],
            **self.place,
            "class": "::".join(classes),
            "parentclass": "::".join(classes[:-1]),
            "parentname": self.parent.name,
            "field": "::".join((*classes[:-1], self.name.lower())),
            "upper": self.name.upper(),
            "lower": "groups" if self.id == 0 else self.name.lower(),
        }

    def _path(self) -> tuple[str, ...]:
        return (self.name,) if self.parent is self else (*self.parent._path(), self.name)


class ParameterGenerator:
    """Replaces ROS's generator: it stores what the file describes, and writes nothing."""

    Group = ParameterGroup
    generated: ClassVar[list[_Generated]] = []
    """The results of the file being executed; cleared by ``config_modules``."""
    file = ""
    groups = 0
    """Number of groups inside the default one; a class attribute, since subclasses need not call the constructor."""

    def __init__(self) -> None:
        self.group = ParameterGroup(self, "Default", "", True, 0, None)
        self.constants: list[dict[str, Any]] = []

    def place(self) -> dict[str, Any]:
        """Return the line of the file being executed."""
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and frame.f_code.co_filename != self.file:
            frame = frame.f_back
        return {"srcline": 0 if frame is None else frame.f_lineno, "srcfile": Path(self.file).name}

    def const(self, name: str, type: str, value: Any, descr: str) -> dict[str, Any]:  # noqa: A002 - ROS's name
        """Describe a constant, for an enum."""
        _check_quotes(descr)
        if type not in _PYTHON_TYPES:
            raise TypeError(f"the constant {name} has the type {type!r}, expected str_t, bool_t, int_t or double_t")
        made = {
            "name": name,
            "type": type,
            "value": _bound(name, type, "value", value, _DEFAULTS),
            **self.place(),
            "description": descr,
            "ctype": _C_TYPES[type],
            "cconsttype": _C_CONSTANTS[type],
        }
        self.constants.append(made)
        return made

    def enum(self, constants: list[dict[str, Any]], description: str) -> str:
        """Return the ``edit_method`` of a parameter whose value is one of the constants."""
        if len({each["type"] for each in constants}) != 1:
            raise ValueError("the constants of an enum are of different types, or there are none")
        _check_quotes(description)
        return repr({"enum": constants, "enum_description": description})

    def add(self, *args: Any, **more: Any) -> None:
        """Describe a parameter of the default group."""
        self.group.add(*args, **more)

    def add_group(self, name: str, type: str = "", state: bool = True) -> ParameterGroup:  # noqa: A002 - ROS's name
        """Add a group."""
        return self.group.add_group(name, type, state)

    def generate(self, pkgname: str, nodename: str, name: str) -> int:
        """Store the description; return 0, which files pass to ``exit``."""
        ParameterGenerator.generated.append(_Generated(name, self.group, tuple(self.constants)))
        return 0


class SensorLevels:
    """The levels of the package driver_base, used by older files."""

    RECONFIGURE_CLOSE, RECONFIGURE_STOP, RECONFIGURE_RUNNING = 3, 1, 0


GENERATOR_NAMES: dict[str, Any] = {
    "ParameterGenerator": ParameterGenerator,
    "str_t": STR,
    "bool_t": BOOL,
    "int_t": INT,
    "double_t": DOUBLE,
    "SensorLevels": SensorLevels,
}
"""The names that ``from dynamic_reconfigure.parameter_generator_catkin import *`` imports."""


def config_module(path: Path, name: str = "") -> dict[str, Any]:
    """Return the names of the module that a build would write for a ``.cfg`` file; raises BadConfig, with file and
    line.

    If the file generates several, return the one called ``name`` (``TutorialsConfig``), or named like the file, or the
    first.
    """
    found = config_modules(path)
    return found.get(name) or found.get(f"{path.stem}Config") or next(iter(found.values()))


def config_modules(path: Path) -> dict[str, dict[str, Any]]:
    """Return the modules that a build would write for a ``.cfg`` file, by name (``TutorialsConfig``).

    Raises BadConfig, with file and line.
    """
    generated = _execute(path)
    if not generated:
        raise BadConfig(f"{path}: it describes no parameters: ParameterGenerator.generate() is never called")
    return {f"{each.name}Config": _module_names(path, each) for each in generated}


def extract_params(group: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return all parameters of a group's description, or of a decoded one, whose groups are a dict."""
    inner: Iterable[Any] = group["groups"]
    if isinstance(inner, Mapping):
        inner = inner.values()
    return [*group["parameters"], *(each for one in inner for each in extract_params(one))]


def enum_constants(parameter: Mapping[str, Any]) -> tuple[Constant, ...]:
    """Return the choices of an enum parameter; none for others."""
    text = parameter["edit_method"]
    if not text:
        return ()
    try:
        stated = ast.literal_eval(text)["enum"]
        return tuple(Constant(each["name"], each["value"], each.get("description", "")) for each in stated)
    except (ValueError, SyntaxError, TypeError, KeyError):
        return ()


def _module_names(path: Path, generated: _Generated) -> dict[str, Any]:
    description = generated.group.to_dict()
    parameters = extract_params(description)
    all_level = 0
    for each in parameters:
        all_level |= each["level"]
    return {
        "__file__": str(path),
        "__doc__": f"The parameters that {path.name} describes.",
        "inf": float("inf"),
        "extract_params": extract_params,
        "config_description": description,
        "all_level": all_level,
        **{
            name: {each["name"]: each[field] for each in parameters}
            for name, field in (
                ("min", "min"),
                ("max", "max"),
                ("defaults", "default"),
                ("level", "level"),
                ("type", "type"),
            )
        },
        **{f"{generated.name}_{each['name']}": each["value"] for each in generated.constants},
    }


def _execute(path: Path) -> list[_Generated]:
    """Execute a file; return what it passed to ``generate``."""
    code = _compile(path)
    hooks = dict(vars(builtins)) | {"__import__": _import, "exit": _exit, "quit": _exit}
    argv, before = sys.argv, (ParameterGenerator.generated, ParameterGenerator.file)
    ParameterGenerator.generated, ParameterGenerator.file = [], str(path)
    sys.argv = [str(path), "", "", "", ""]
    try:
        exec(code, {"__name__": "__main__", "__file__": str(path), "__builtins__": hooks})
    except SystemExit as ended:
        if ended.code not in (None, 0) and not ParameterGenerator.generated:
            raise BadConfig(f"{_where(path, ended)}: it ends with exit({ended.code!r})") from None
    except Exception as error:  # noqa: BLE001 - whatever a user's file may raise
        raise BadConfig(f"{_where(path, error)}: {_reason(error)}") from None
    finally:
        generated = ParameterGenerator.generated
        sys.argv, (ParameterGenerator.generated, ParameterGenerator.file) = argv, before
    return generated


def _compile(path: Path) -> CodeType:
    """Compile a file, which may be written for Python 2."""
    text = _read(path)
    try:
        code = compile(text, str(path), "exec", dont_inherit=True)
    except (SyntaxError, ValueError) as error:
        with suppress(SyntaxError):
            return compile(python2.convert(text, str(path)), str(path), "exec", dont_inherit=True)
        line = getattr(error, "lineno", None) or 1
        raise BadConfig(f"{path}:{line}: {getattr(error, 'msg', None) or error}") from None
    if python2.looks_like_python2(text):
        with suppress(SyntaxError):
            return compile(python2.convert(text, str(path)), str(path), "exec", dont_inherit=True)
    return code


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BadConfig(f"{path}: it is larger than {MAX_BYTES} bytes, the limit for a .cfg file")
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise BadConfig(f"{path}: it cannot be read: {error.strerror or error}") from None


def _import(name: str, *args: Any, **more: Any) -> Any:
    """``__import__`` for a ``.cfg`` file: the generator is ours, and modules needed only by a build may be missing."""
    fromlist = (args[2] if len(args) > 2 else more.get("fromlist")) or ()
    if name in ("dynamic_reconfigure.parameter_generator_catkin", "dynamic_reconfigure.parameter_generator"):
        return _generator_package(name, bool(fromlist))
    if name == "dynamic_reconfigure" and any(each.startswith("parameter_generator") for each in fromlist):
        return _generator_package(name, submodule=False)
    if name == "driver_base.msg" and fromlist:
        return _module(name, {"SensorLevels": SensorLevels})
    try:
        return builtins.__import__(name, *args, **more)
    except ModuleNotFoundError:
        if name == "roslib":
            return _module(name, {"load_manifest": lambda package: None})
        raise


def _generator_package(name: str, submodule: bool) -> ModuleType:
    generator = _module(name, GENERATOR_NAMES | {"__all__": list(GENERATOR_NAMES)})
    if submodule:
        return generator
    return _module("dynamic_reconfigure", {"parameter_generator_catkin": generator, "parameter_generator": generator})


def _module(name: str, names: Mapping[str, Any]) -> ModuleType:
    made = ModuleType(name)
    vars(made).update(names)
    return made


def _exit(code: object = None) -> None:
    raise SystemExit(code)


def _where(path: Path, error: BaseException) -> str:
    """Return the innermost line of the file in the error's traceback."""
    lines = [each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == str(path)]
    return f"{path}:{lines[-1]}" if lines else str(path)


def _reason(error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError):
        return f"it imports {error.name}, which was not found: is its package in the workspace?"
    return f"{type(error).__name__}: {error}"


def _bound(name: str, paramtype: str, field: str, value: Any, otherwise: Mapping[str, Any]) -> Any:
    """Convert a default or bound to its parameter's type, or replace a missing one; raises TypeError."""
    if value is None:
        return otherwise[paramtype]
    expected: Any = _PYTHON_TYPES[paramtype]
    if type(value) is not expected and not (expected is float and type(value) is int):
        raise TypeError(f"{name} has the type {paramtype}, but its {field} is {value!r}")
    return expected(value)


def _check_quotes(text: str) -> None:
    if '"' in text or "'" in text:
        raise ValueError(f"the description {text!r} contains quotes, which are not allowed")
