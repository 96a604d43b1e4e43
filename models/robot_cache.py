"""The folders of imported robots in the user's cache: created once, read by every process, removed when unused."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from messages.errors import BadInput

UNUSED_DAYS = 30
"""Days after which an unused robot is removed."""

IMPORTED = re.compile(r"[A-Za-z0-9_.]+-[0-9a-f]{16}")
"""Name of a robot's folder: the robot's name and the hash of all its inputs."""


def robots_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of imported robots: ``elea/robots`` in the user's cache (XDG base directory specification)."""
    base = environment.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "elea" / "robots"


def is_imported(model: str) -> bool:
    """Whether a model is the folder of an imported robot."""
    return IMPORTED.fullmatch(model.rpartition("/")[2]) is not None and Path(model).is_absolute()


def display_name(model: str) -> str:
    """Return the display name of a model; for an imported robot, without its cache folder and hash."""
    return model.rpartition("/")[2].rpartition("-")[0] if is_imported(model) else model


def write_folder(folder: Path, write: Callable[[Path], None]) -> None:
    """Create a folder atomically, filled by ``write``; raises BadInput."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        begun = Path(tempfile.mkdtemp(prefix=".", dir=folder.parent))
    except OSError as error:
        raise BadInput(
            f"{folder.parent} cannot be written ({error.strerror}): set XDG_CACHE_HOME to a folder of yours"
        ) from None
    try:
        write(begun)
        begun.rename(folder)
    except OSError as error:
        if not folder.is_dir():  # or another process was first, with the same files
            raise BadInput(f"{folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(begun, ignore_errors=True)
    _remove_unused(folder.parent)


def _remove_unused(parent: Path) -> None:
    oldest = time.time() - UNUSED_DAYS * 86400
    for each in parent.iterdir():
        try:
            if each.stat().st_mtime < oldest:
                shutil.rmtree(each, ignore_errors=True)
        except OSError:
            continue
