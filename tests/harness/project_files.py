"""Lists the project's files as in a fresh clone: without environments, caches and results."""

from __future__ import annotations

import os
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

from services.runtime.process import ROOT

PACKAGES = ("messages", "services", "models", "deploy")
_IGNORED = [line.rstrip("/") for line in (ROOT / ".gitignore").read_text().split()] + [".git"]


def project_files(*suffixes: str, under: Path = ROOT) -> Iterator[Path]:
    """Yield every file not ignored by .gitignore, or those with one of these suffixes."""
    for folder, folders, names in os.walk(under):
        folders[:] = sorted(each for each in folders if not _ignored(Path(folder), each))
        for name in sorted(names):
            if not _ignored(Path(folder), name) and (not suffixes or name.endswith(suffixes)):
                yield Path(folder) / name


def _ignored(folder: Path, name: str) -> bool:
    """Whether .gitignore ignores it; a pattern with a leading slash applies only in the project's folder."""
    return any(fnmatch(name, each.removeprefix("/")) for each in _IGNORED if folder == ROOT or not each.startswith("/"))
