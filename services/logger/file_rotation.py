"""Rotates recordings, so that a restarted logger never overwrites an earlier one."""

from __future__ import annotations

from itertools import count
from pathlib import Path

from services.runtime.errors import BadInput


def rotate(file: Path) -> Path | None:
    """Rename an existing recording to ``run-1.rrd``, ``run-2.rrd``, …; return its new path, None if there was none.

    A logger that crashed is restarted with the same file name, and rerun truncates the file that it opens. Raises
    BadInput if the folder cannot be written.
    """
    try:
        if not file.is_file() or file.stat().st_size == 0:
            return None
        aside = next(each for n in count(1) if not (each := file.with_stem(f"{file.stem}-{n}")).exists())
        return file.rename(aside)
    except OSError as error:
        raise BadInput(f"the recording cannot be written: {file.parent}: {error.strerror}") from None


def rotated(file: Path) -> list[Path]:
    """Return the rotated recordings of this file, oldest first."""
    found = (each for each in file.parent.glob(f"{file.stem}-*{file.suffix}"))
    numbered = [(each.stem.removeprefix(f"{file.stem}-"), each) for each in found]
    return [each for number, each in sorted((int(n), each) for n, each in numbered if n.isdecimal())]
