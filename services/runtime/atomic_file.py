"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path


def write_atomic(path: Path, content: bytes, durable: bool = False, mode: int = 0o666) -> None:
    """Put ``content`` in place of what ``path`` held: a reader, or a crash of this process, finds the old or the new.

    Args:
        path: The file, in a folder that exists.
        content: All of the new content.
        durable: Also outlive a power cut: the content and the entry of the folder are on the disk at the return.
            Without it, the file may be empty or old after one.
        mode: The rights of the file, less those that the process' mask takes away.

    Raises:
        OSError: It cannot be written; what was there is untouched.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.unlink(missing_ok=True)
    try:
        # O_EXCL: no link that somebody has put there is followed.
        with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode), "wb") as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    if durable:
        fsync_path(path.parent)


def fsync_path(path: Path) -> None:
    """Bring what was written to a file, or the names in a folder, to the disk; raises OSError."""
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
