"""Imports of message packages from their definitions: ``std_msgs.msg``, ``my_pkg.srv``, ``my_pkg.cfg.TutorialsConfig``.

The finder precedes Python's own for these submodules, whatever ``<pkg>`` itself is: the package's own modules in
``src/<pkg>``, a library of ours, or, without either, an empty package that the finder creates.
"""

from __future__ import annotations

import ast
import importlib
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

from messages.errors import BadInput, did_you_mean
from messages.interfaces import Catalogue
from messages.interfaces.catalogue import ACTION_PARTS, SERVICE_PARTS
from services.script.reconfigure_config import config_module

_MODULE = re.compile(r"(\w+)\.(msg|srv|cfg)(?:\.(\w+))?")

Packages = Callable[[str], Path | None]


class InterfaceModule(ModuleType):
    """A module whose classes are created when first accessed."""

    def __init__(self, name: str, names: Iterable[str], make: Callable[[str], Any]) -> None:
        super().__init__(name)
        self.__all__ = sorted(names)
        self.__path__: list[str] = []
        self._make = make

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name not in self.__all__:
            hint = did_you_mean(name, self.__all__) if not name.startswith("_") else ""
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}{hint}")
        made = self._make(name)
        setattr(self, name, made)
        return made

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.__all__})


class InterfaceFinder(MetaPathFinder):
    """Finds the submodules ``msg``, ``srv`` and ``cfg`` of packages that define them.

    Args:
        catalogue: The definitions.
        packages: Finds a package's folder by name.
    """

    def __init__(self, catalogue: Catalogue, packages: Packages) -> None:
        self._catalogue, self._packages = catalogue, packages

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a module of definitions, or None for all others."""
        found = _MODULE.fullmatch(fullname)
        if found is None:
            return None
        package, kind, own = found.groups()
        create = self._cfg_module(package, own) if kind == "cfg" else self._types_module(package, kind, own)
        if create is None:
            return None
        return ModuleSpec(fullname, _ModuleLoader(create), origin=f"definitions of {package}", is_package=own is None)

    def _types_module(self, package: str, kind: str, own: str | None) -> Callable[[str], ModuleType] | None:
        names = self._type_names(package, kind)
        if not names or (own is not None and own.removeprefix("_") not in names):
            return None
        if own is not None:
            single = own.removeprefix("_")
            parts = [single + part for part in ("", *SERVICE_PARTS)] if kind == "srv" else [single]
            names = [name for name in names if name in parts]
        return lambda name: InterfaceModule(name, names, lambda each: self._class(package, kind, each))

    def _type_names(self, package: str, kind: str) -> list[str]:
        if kind == "srv":
            services = self._catalogue.types(package, "srv")
            return [name + part for name in services for part in ("", *SERVICE_PARTS)]
        actions = self._catalogue.types(package, "action")
        return [*self._catalogue.types(package, "msg"), *(name + part for name in actions for part in ACTION_PARTS)]

    def _class(self, package: str, kind: str, name: str) -> type:
        classes = importlib.import_module("genpy.message").classes  # only on the path of a script's process

        found: type
        if kind == "srv" and name in self._catalogue.types(package, "srv"):
            found = classes.service(f"{package}/{name}")
        else:
            found = classes.message(f"{package}/{name}")
        return found

    def _cfg_module(self, package: str, own: str | None) -> Callable[[str], ModuleType] | None:
        folder = self._packages(package)
        if folder is None or not any((folder / "cfg").glob("*.cfg")):
            return None
        if own is None:
            return lambda name: InterfaceModule(name, (), lambda each: None)
        file = _cfg_file(folder / "cfg", own.removesuffix("Config")) if own.endswith("Config") else None
        return None if file is None else lambda name: _config(name, file)


class PackageFinder(MetaPathFinder):
    """Finds packages that have definitions but no module of their own; it comes after Python's finders."""

    def __init__(self, catalogue: Catalogue, packages: Packages) -> None:
        self._catalogue, self._packages = catalogue, packages

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of an empty package, or None."""
        if "." in fullname:
            return None
        if not self._catalogue.has_package(fullname):
            folder = self._packages(fullname)
            if folder is None or not (folder / "cfg").is_dir():
                return None
        return ModuleSpec(fullname, _ModuleLoader(_package), origin=f"definitions of {fullname}", is_package=True)


class _ModuleLoader(Loader):
    """Creates a module by calling a function with its name."""

    def __init__(self, create: Callable[[str], ModuleType]) -> None:
        self._create = create

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return self._create(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: the module is complete when created."""


def install(catalogue: Catalogue, packages: Packages) -> None:
    """Make ``import`` find the message packages of the catalogue, and those whose folder ``packages`` finds."""
    catalogue.locate = packages
    uninstall()
    sys.meta_path.insert(0, InterfaceFinder(catalogue, packages))
    sys.meta_path.append(PackageFinder(catalogue, packages))


def uninstall() -> None:
    """Undo ``install``."""
    sys.meta_path[:] = [each for each in sys.meta_path if not isinstance(each, InterfaceFinder | PackageFinder)]


def _package(name: str) -> ModuleType:
    made = ModuleType(name)
    made.__path__ = []
    return made


def _cfg_file(folder: Path, name: str) -> Path | None:
    """Return the file that generates the config ``name``: the third argument of its ``generate``, usually its own name
    too.
    """
    files = sorted(folder.glob("*.cfg"))
    return next((file for file in files if name in _generated(file)), None)


def _generated(file: Path) -> set[str]:
    """Return the names that a .cfg file generates: the third arguments of ``generate``, or else its own name."""
    try:
        tree = ast.parse(file.read_bytes(), str(file))
    except (SyntaxError, ValueError):
        return {file.stem}
    calls = [
        node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "generate"
    ]
    names = {
        argument.value
        for call in calls
        for argument in [*call.args[2:3], *(each.value for each in call.keywords if each.arg == "name")]
        if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
    }
    return names or {file.stem}


def _config(name: str, file: Path) -> ModuleType:
    made = ModuleType(name)
    made.__file__ = str(file)
    try:
        vars(made).update(config_module(file, name.rpartition(".")[2]))
    except BadInput as error:
        raise ImportError(str(error), name=name, path=str(file)) from error
    return made
