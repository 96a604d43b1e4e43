"""The project's own files, as a clone has them: without environments, caches and results."""

from __future__ import annotations

import os
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

from services.runtime.process import ROOT

PACKAGES = ("messages", "services", "models", "deploy")
_IGNORED = [line.rstrip("/") for line in (ROOT / ".gitignore").read_text().split()] + [".git"]


def files(*suffixes: str, under: Path = ROOT) -> Iterator[Path]:
    """Every file, or those with one of these suffixes, that .gitignore does not name."""
    for folder, folders, names in os.walk(under):
        folders[:] = sorted(each for each in folders if not _ignored(each))
        for name in sorted(names):
            if not _ignored(name) and (not suffixes or name.endswith(suffixes)):
                yield Path(folder) / name


def _ignored(name: str) -> bool:
    return any(fnmatch(name, each) for each in _IGNORED)
