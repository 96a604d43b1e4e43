"""The installation: the version, the environment, its packages against the lock, and libraries that load."""

from __future__ import annotations

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

NATIVE_LIBRARIES = ("zenoh", "pybullet", "rerun", "numpy", "matplotlib")
"""Libraries with native code: installed is not yet loadable."""
LOAD_TIMEOUT_S = 60.0
_PINNED = re.compile(r"^([\w.-]+)==([^\s;\\]+)( ;)?", re.MULTILINE)
REINSTALL = "remove .venv and start ./elea again: it installs what the lock says"


def version(root: Path = ROOT) -> Iterator[Finding]:
    """One version everywhere, and our own packages where they should be."""
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
    """The environment is the one that ./elea made, whole."""
    own = root / ".venv"
    if Path(sys.prefix).resolve() != own.resolve():
        yield warn(
            "environment", f"Python runs in {sys.prefix}, not in {own}", "start with ./elea, which makes and uses it"
        )
    elif not (own / ".complete").is_file():
        yield warn("environment", f"{own} is not complete: it was interrupted", REINSTALL)
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
        yield ok("packages", f"{len(pinned)} as in requirements.lock")


def libraries() -> Iterator[Finding]:
    """The libraries with native code load; each in a process of its own, since one may end it."""
    started = {
        name: subprocess.Popen(
            [sys.executable, "-P", "-c", f"import {name}"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name in NATIVE_LIBRARIES
    }
    broken = []
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
        yield fail("libraries", "; ".join(broken), f"install the libraries named there, else {REINSTALL}")
    else:
        yield ok("libraries", f"{', '.join(NATIVE_LIBRARIES)} load")
