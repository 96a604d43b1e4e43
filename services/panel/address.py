"""The file that says where the page is, for ``./elea panel``: readable by its owner alone, since it holds the token."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import msgspec

FILE = "panel.json"
"""Its name in the folder of a run."""


class Address(msgspec.Struct, frozen=True, kw_only=True):
    """Where the page is, and what opens it."""

    port: int
    token: str
    pid: int

    @property
    def url(self) -> str:
        """The address to open, token and all."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"


def write(path: Path, address: Address) -> None:
    """Put the file there, whole or not at all; raises OSError."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.unlink(missing_ok=True)
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(msgspec.json.encode(address))
    beside.replace(path)


def read(path: Path) -> Address | None:
    """The address in a file, None when there is none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Address)
    except (OSError, msgspec.MsgspecError):
        return None


def token_for(path: Path | None) -> str:
    """The token of an earlier life of this panel, so that its pages still count after a restart; else a new one."""
    earlier = read(path) if path is not None else None
    return earlier.token if earlier and len(earlier.token) >= 32 else secrets.token_urlsafe(24)
