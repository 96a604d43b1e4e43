"""Reads user-supplied files: regular files only, up to a maximum size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from messages.errors import BadInput


def read_limited(path: Path, limit: int, what: str) -> bytes:
    """Return the content of a regular file of at most ``limit`` bytes.

    Args:
        path: The file; links are followed.
        limit: Maximum size [bytes].
        what: What the file should be, for the error: "a URDF".

    Raises:
        BadInput: The file does not exist, cannot be read, is too large, or is a folder, pipe, socket or device.
    """
    try:
        # Opening a pipe without a writer would block forever.
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    found = os.fstat(number)
    if not stat.S_ISREG(found.st_mode):
        os.close(number)
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe, socket or device"
        raise BadInput(f"{path} is {kind}, not {what}")
    with open(number, "rb") as file:
        if found.st_size > limit:
            raise BadInput(f"{path} has {found.st_size} bytes, the limit of {what} is {limit}")
        content = file.read(limit + 1)
    if len(content) > limit:
        raise BadInput(f"{path} has more than {limit} bytes, the limit of {what}")
    return content
