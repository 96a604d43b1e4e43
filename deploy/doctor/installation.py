"""Checks the installation: version, environment, packages against the lock, and that libraries load."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from deploy import VERSION
from deploy.doctor import Finding, fail, ok, warn
from services.runtime.errors import BadInput
from services.runtime.process import ROOT, check_import_roots
from services.sim.engines import ENGINES, has_engine

NATIVE_LIBRARIES = ("zenoh", *(each for each in ENGINES if has_engine(each)), "rerun_bindings", "numpy", "matplotlib")
"""Libraries with native code, which may be installed but fail to load."""
LOAD_TIMEOUT_S = 60.0
_LOAD = "import ctypes, os, sys\nfor each in sys.argv[1:]: ctypes.CDLL(each, os.RTLD_NOW)\nos._exit(0)"
"""Loads files as an import would, with all their dependencies; the imports themselves take 3 s of processor time."""
_PINNED = re.compile(r"^([\w.-]+)==([^\s;\\]+)( ;)?", re.MULTILINE)
REINSTALL = "remove .venv and start ./elea again: it installs what the lock says"


def version(root: Path = ROOT) -> Iterator[Finding]:
    """Check that there is a single version, and that our packages are imported from it."""
    try:
        check_import_roots()
        stated = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    except BadInput as error:
        yield fail("version", str(error), "unset PYTHONPATH, and start with ./elea")
        return
    except (OSError, ValueError, KeyError) as error:
        yield fail("version", f"pyproject.toml cannot be read: {error}", "get the project's files again")
        return
    if stated == VERSION:
        yield ok("version", f"Elea {VERSION} in {root}")
    else:
        yield fail(
            "version",
            f"pyproject.toml says {stated}, the code {VERSION}",
            "get the project's files again, all of one version",
        )


def environment(root: Path = ROOT) -> Iterator[Finding]:
    """Check that the environment is the one that ./elea created, and complete."""
    own = root / ".venv"
    if Path(sys.prefix).resolve() != own.resolve():
        yield warn(
            "environment", f"Python runs in {sys.prefix}, not in {own}", "start with ./elea, which makes and uses it"
        )
    elif not (own / ".complete").is_file():
        yield warn("environment", f"{own} is incomplete: the installation was interrupted", REINSTALL)
    else:
        yield ok("environment", str(own))


def packages(root: Path = ROOT) -> Iterator[Finding]:
    """Compare the installed packages with requirements.lock; those for other systems may be missing."""
    try:
        pinned = _PINNED.findall((root / "requirements.lock").read_text())
    except OSError as error:
        yield fail("packages", f"requirements.lock cannot be read: {error.strerror}", "get the project's files again")
        return
    wrong = []
    for name, wanted, elsewhere in pinned:
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            if not elsewhere:
                wrong.append(f"{name} is missing")
            continue
        if found != wanted:
            wrong.append(f"{name} is {found}, the lock says {wanted}")
    if wrong:
        more = f" and {len(wrong) - 5} more" if len(wrong) > 5 else ""
        yield fail("packages", "; ".join(wrong[:5]) + more, REINSTALL)
    else:
        yield ok("packages", f"{len(pinned)} packages as in requirements.lock")


def libraries() -> Iterator[Finding]:
    """Check that the libraries' native code loads, each in its own process, since loading may crash it."""
    started, broken = {}, []
    for name in NATIVE_LIBRARIES:
        if (files := _native_files(name)) is None:
            broken.append(f"{name}: ModuleNotFoundError: No module named {name!r}")
            continue
        started[name] = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _LOAD, *files],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
    for name, process in started.items():
        try:
            _, errors = process.communicate(timeout=LOAD_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            broken.append(f"{name} does not load within {LOAD_TIMEOUT_S:g} s")
            continue
        if process.returncode:
            last = errors.strip().splitlines()[-1:] or [f"status {process.returncode}"]
            broken.append(f"{name}: {last[0]}")
    if broken:
        yield fail("libraries", "; ".join(broken), f"install the libraries named there, or {REINSTALL}")
    else:
        yield ok("libraries", f"{', '.join(NATIVE_LIBRARIES)} load")


def _native_files(name: str) -> list[str] | None:
    """Return the native files of a library without importing it; None if there is no such library."""
    found = importlib.util.find_spec(name)
    if found is None or found.origin is None:
        return None
    origin = Path(found.origin)
    files = origin.parent.rglob("*.so") if found.submodule_search_locations else [origin]
    return sorted(str(each) for each in files if each.suffix == ".so")
