"""The project's own files, as a clone has them: without environments, caches and results."""

from __future__ import annotations

import os
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

from services.runtime.process import ROOT

PACKAGES = ("messages", "services", "models", "deploy")
_IGNORED = [line.rstrip("/") for line in (ROOT / ".gitignore").read_text().split()] + [".git"]


def project_files(*suffixes: str, under: Path = ROOT) -> Iterator[Path]:
    """Every file, or those with one of these suffixes, that .gitignore does not name."""
    for folder, folders, names in os.walk(under):
        folders[:] = sorted(each for each in folders if not _ignored(Path(folder), each))
        for name in sorted(names):
            if not _ignored(Path(folder), name) and (not suffixes or name.endswith(suffixes)):
                yield Path(folder) / name


def _ignored(folder: Path, name: str) -> bool:
    """A pattern that begins with a slash counts in the project's folder alone."""
    return any(fnmatch(name, each.removeprefix("/")) for each in _IGNORED if folder == ROOT or not each.startswith("/"))
