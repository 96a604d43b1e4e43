"""The log of a process: what it writes goes to a file of bounded size, and nothing that happens there can stop it."""

from __future__ import annotations

import os
import threading
from pathlib import Path

LARGEST = 8 << 20
"""Bytes of a log file; it is then renamed to ``.1`` in place of an older one, and a new one begun."""

LONGEST = 500
"""Characters of a process's last words."""

_CHUNK = 1 << 16
_NOTE = "--- "


def log_name(process: str) -> str:
    """The file name of a process's log: ``tb3_0/waypoint`` logs to ``tb3_0.waypoint.log``."""
    return f"{process.replace('/', '.')}.log"


def pump(pipe: int, path: Path, largest: int = LARGEST) -> threading.Thread:
    """Read the file descriptor ``pipe`` to its end in a thread of its own, and close it."""
    thread = threading.Thread(target=_pump, args=(pipe, path, largest), name=f"log {path.name}", daemon=True)
    thread.start()
    return thread


def note(path: Path, text: str) -> None:
    """Append a line of the supervisor's own; a disk that refuses it is not worth a fleet."""
    try:
        with path.open("ab") as file:
            file.write(f"{_NOTE}{text}\n".encode())
    except OSError:
        return


def last_words(path: Path) -> str:
    """The last line that the process itself has written, at most LONGEST characters; empty when there is none."""
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - _CHUNK))
            lines = file.read(_CHUNK).decode(errors="replace").splitlines()
    except OSError:
        return ""
    own = (line.strip() for line in reversed(lines) if line.strip() and not line.startswith(_NOTE))
    return next(own, "")[:LONGEST]


def _pump(pipe: int, path: Path, largest: int) -> None:
    with os.fdopen(pipe, "rb", buffering=0) as source:
        while chunk := source.read(_CHUNK):
            _append(path, chunk, largest)


def _append(path: Path, chunk: bytes, largest: int) -> None:
    """Write, or drop the chunk when the disk is full or gone: the process must go on."""
    try:
        if path.exists() and path.stat().st_size + len(chunk) > largest:
            path.replace(path.with_name(f"{path.name}.1"))
        with path.open("ab") as file:
            file.write(chunk)
    except OSError:
        return
