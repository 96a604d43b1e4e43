"""Atomic writing of files."""

from __future__ import annotations

import os
from pathlib import Path


def write_atomic(path: Path, content: bytes, durable: bool = False, mode: int = 0o666) -> None:
    """Replace a file's content atomically: even after a crash of this process, a reader finds the old or the new one.

    Args:
        path: The file, in a folder that exists.
        content: The whole new content.
        durable: Survive a power cut: content and folder entry are synced to the disk before the return. Without it,
            the file may be empty or old after one.
        mode: The permissions of the file, less those removed by the process's umask.

    Raises:
        OSError: The file cannot be written; the old one is untouched.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.unlink(missing_ok=True)
    try:
        # O_EXCL: an existing link is not followed.
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode), "wb") as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    if durable:
        fsync_path(path.parent)


def fsync_path(path: Path) -> None:
    """Sync a file's content, or a folder's entries, to the disk; raises OSError."""
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
