"""Loads a script and runs it as ``__main__``; its own modules get counted loops, and replaced time and threading
modules.

Its own modules are those in its folder and in the packages of its workspace. Libraries are not changed.
"""

from __future__ import annotations

import builtins
import functools
import importlib
import io
import os
import random
import sys
import time
import zlib
from collections.abc import Callable, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from services.runtime.process import ROOT
from services.script import old_names, opencv_windows
from services.script.budget import WHILE_PASSES
from services.script.missing_modules import MODERN, explain_missing
from services.script.source import DIVIDE, PASS, TOSTRING, compile_script, divide
from services.script.workspace import Workspace

SITE_PACKAGES = ROOT / "services" / "ros1" / "site-packages"
"""The imitated libraries of ROS 1."""


class ScriptLoader:
    """Runs one script.

    Args:
        folders: The folders of the script's own modules.
        modules: Replacements of Python's modules when these modules import them.
        extras: Builtins of these modules besides Python's.
        workspace: The packages around the script, for the error text about a missing one.
    """

    def __init__(
        self,
        folders: Sequence[Path],
        modules: dict[str, ModuleType],
        extras: dict[str, Any],
        workspace: Workspace | None = None,
        imported: Callable[[str], None] = lambda name: None,
    ) -> None:
        self._folders = tuple(os.path.join(os.path.abspath(each), "") for each in folders)
        self._modules, self._workspace, self._imported = modules, workspace, imported
        self._adapted: set[str] = set()
        self._builtins = {**builtins.__dict__, **extras, "__import__": self._import}

    def run(self, file: Path) -> None:
        """Run the file as the main program; raises what the file raises."""
        sys.meta_path.insert(0, _OwnModules(self))
        module = ModuleType("__main__")
        module.__dict__.update(__file__=sys.argv[0], __builtins__=self._builtins)
        sys.modules["__main__"] = module
        exec(compile_script(file), module.__dict__)

    def owns(self, origin: str) -> bool:
        """Return whether a file is one of the script's own modules."""
        path = os.path.abspath(origin)
        inside = any(path.startswith(each) for each in self._folders)
        return inside and "site-packages" not in path and not path.startswith(_NOT_OWN)

    def prepare(self, module: ModuleType) -> None:
        """Give one of the script's own modules its builtins."""
        module.__dict__["__builtins__"] = self._builtins

    def _adapt(self, name: str) -> None:
        """Adapt a library to scripts of ROS 1 when it is first imported."""
        if name in self._adapted:
            return
        self._adapted.add(name)
        if name == "cv2":
            opencv_windows.adapt(sys.modules[name], self._modules.get("time", time).sleep)
        elif (adapter := old_names.ADAPTERS.get(name)) is not None:
            adapter(sys.modules[name])

    def _import(self, name: str, scope: Any = None, inner: Any = None, fromlist: Any = (), level: int = 0) -> Any:
        if level == 0:
            if (ours := self._modules.get(name)) is not None:
                return ours
            self._imported(name.partition(".")[0])
        try:
            found = builtins.__import__(name, scope, inner, fromlist, level)
            if not level:
                self._adapt(name.partition(".")[0])
            return found
        except ModuleNotFoundError as error:
            if level or error.name is None or not (name == error.name or name.startswith(f"{error.name}.")):
                raise
            if (modern := MODERN.get(name)) is not None:
                return self._modules.get(modern) or importlib.import_module(modern)
            if (beside := _import_beside(name, scope, inner, fromlist)) is not None:
                return beside
            frame = sys._getframe(1)
            place = f"{os.path.basename(frame.f_code.co_filename)}:{frame.f_lineno}"
            text = explain_missing(name, place, self._workspace)
            raise ModuleNotFoundError(text, name=error.name) from None


def _import_beside(name: str, scope: Any, inner: Any, fromlist: Any) -> Any:
    """Return the module next to the importing one in its package, where Python 2 looked first; None
    if there is none.
    """
    package = (scope or {}).get("__package__")
    if not package:
        return None
    try:
        return builtins.__import__(name, scope, inner, fromlist, 1)
    except ModuleNotFoundError as error:
        if error.name != f"{package}.{name.partition('.')[0]}":
            raise
        return None


_NOT_OWN = (str(ROOT / "services") + os.sep, str(ROOT / "messages") + os.sep, str(ROOT / "models") + os.sep)


class _OwnModules(MetaPathFinder):
    """Finds the script's own modules where Python does, and loads them by ``_OwnLoader``."""

    def __init__(self, loader: ScriptLoader) -> None:
        self._loader = loader

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is None or type(spec.loader) is not SourceFileLoader or not spec.origin:
            return None
        if not self._loader.owns(spec.origin):
            return None
        spec.loader = _OwnLoader(fullname, spec.origin, self._loader)
        return spec


class _OwnLoader(SourceFileLoader):
    """Compiles a module like the script itself; writes no cache next to it."""

    def __init__(self, fullname: str, path: str, loader: ScriptLoader) -> None:
        super().__init__(fullname, path)
        self._script = loader

    def get_code(self, fullname: str) -> CodeType:
        return compile_script(Path(self.path))

    def exec_module(self, module: ModuleType) -> None:
        self._script.prepare(module)
        super().exec_module(module)


def loop_pass(point: Callable[[float], None]) -> Callable[[], None]:
    """Return the function called at the head of each loop: it counts one point per WHILE_PASSES passes."""
    left = WHILE_PASSES

    def passed() -> None:
        nonlocal left
        left -= 1
        if not left:
            left = WHILE_PASSES
            point(1.0)

    return passed


def python2_builtins(read_line: Callable[..., str]) -> dict[str, Any]:
    """Return builtins of Python 2, which a text that needs no conversion may still use."""

    def cmp(one: Any, two: Any) -> int:
        return int(one > two) - int(one < two)

    def execfile(path: str, scope: Any = None, inner: Any = None) -> None:
        frame = sys._getframe(1)
        exec(compile_script(Path(path)), frame.f_globals if scope is None else scope, inner)

    return {
        "raw_input": read_line,
        "xrange": range,
        "unicode": str,
        "basestring": str,
        "long": int,
        "unichr": chr,
        "reduce": functools.reduce,
        "reload": importlib.reload,
        "intern": sys.intern,
        "cmp": cmp,
        "execfile": execfile,
        PASS: lambda: None,
        DIVIDE: divide,
        TOSTRING: old_names.tostring,
    }


def pin_randomness(seed: int, node: str) -> Callable[[str], None]:
    """Make the script's unseeded random numbers the same in every run; return a function to call at its imports.

    ``os.urandom`` is fixed as well, except for the runtime, which needs unique names.
    """
    number = (seed << 32) ^ zlib.crc32(node.encode())
    source, true_urandom = random.Random(number), os.urandom

    def urandom(size: int) -> bytes:
        user = sys._getframe(1).f_globals.get("__name__", "")
        return true_urandom(size) if user.startswith(("services.", "secrets")) else source.randbytes(size)

    os.urandom = urandom
    random._urandom = urandom  # type: ignore[attr-defined]
    random.seed(number)
    seeded = False

    def imported(name: str) -> None:
        nonlocal seeded
        if not seeded and (name == "numpy" or "numpy.random" in sys.modules):
            seeded = True
            numpy_random = importlib.import_module("numpy.random")
            numpy_random.seed((number ^ seed) % (1 << 32))

    return imported


class Keyboard(io.TextIOBase):
    """Standard input of a script in lockstep: a thread that reads it ends its turn in the meantime."""

    def __init__(self, stream: Any, outside: Callable[[str], Any]) -> None:
        self._stream, self._outside = stream, outside

    def read(self, size: int | None = -1, /) -> str:
        with self._outside("standard input"):
            return str(self._stream.read(size))

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        with self._outside("standard input"):
            return str(self._stream.readline(size))

    def fileno(self) -> int:
        with self._outside("standard input"):
            return int(self._stream.fileno())

    def isatty(self) -> bool:
        return bool(self._stream.isatty())
