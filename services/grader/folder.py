"""The folder of a run: made in time, and files written to it whole or not at all."""

from __future__ import annotations

import tempfile
from pathlib import Path

from services.runtime import files
from services.runtime.errors import BadInput


def prepare(folder: Path) -> Path:
    """Make the folder and try to write in it; raises BadInput now rather than after the run."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise BadInput(
            f"the output folder {folder} cannot be written ({error.strerror}): choose another, or change its rights"
        ) from None


def write_whole(path: Path, content: bytes) -> None:
    """Put ``content`` in place of what ``path`` held; a reader sees the old or the new. Raises BadInput.

    It is on the disk when this returns, so that a power failure does not leave an empty file.
    """
    try:
        files.write_whole(path, content, durable=True)
    except OSError as error:
        raise BadInput(f"{path} cannot be written: {error.strerror}") from None
