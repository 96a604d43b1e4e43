"""Which fleets run on this machine: one file each, locked by its supervisor as long as it lives.

The lock, not the number in the file, says that a fleet runs: the kernel lifts it with the process, however it dies, so
a number that another process got later is never taken for a supervisor.
"""

from __future__ import annotations

import fcntl
import os
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgspec

from services.runtime.errors import BadInput

_PATIENCE_S = 1.0
"""Others look at a lock for a moment; a claim waits so long [s] for them."""


class Running(msgspec.Struct, frozen=True, kw_only=True):
    """A fleet that runs: what its files, its supervisor and its router are called; ``saved`` are its parameters."""

    fleet: str
    mode: str
    port: int
    pid: int
    folder: str
    started: str
    domain: str = ""
    root: str = ""
    saved: str = ""


def folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Where the files lie: ``elea`` in the user's state folder (XDG base directory specification)."""
    base = environment.get("XDG_STATE_HOME", "")
    return (Path(base) if base else Path.home() / ".local" / "state") / "elea"


@contextmanager
def claim(entry: Running) -> Iterator[None]:
    """Hold the port for this fleet; raises BadInput when another fleet, or another program, holds it."""
    path = folder() / f"{entry.port}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise BadInput(
            f"{path} cannot be written ({error.strerror}): set XDG_STATE_HOME to a folder of yours"
        ) from None
    with os.fdopen(descriptor, "r+b") as file:
        if not _lock(file.fileno()) or not _free(entry.port):
            raise _taken(entry.port)
        file.truncate(0)
        file.write(msgspec.json.encode(entry))
        file.flush()
        yield


def running() -> tuple[Running, ...]:
    """Every fleet of this user that runs now."""
    found = []
    for path in sorted(folder().glob("*.json")):
        try:
            with path.open("rb") as file:
                if not held(file.fileno()):
                    continue
                found.append(msgspec.json.decode(file.read(), type=Running))
        except (OSError, msgspec.MsgspecError):
            continue
    return tuple(found)


def held(descriptor: int) -> bool:
    """Whether another process has locked the open file for itself."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(descriptor, fcntl.LOCK_UN)
    return False


def _lock(descriptor: int) -> bool:
    deadline = time.monotonic() + _PATIENCE_S
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.02)


def _free(port: int) -> bool:
    """Whether a router could listen there."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def _taken(port: int) -> BadInput:
    for other in running():
        if other.port == port:
            return BadInput(
                f"port {port} is held by the fleet {other.fleet} (supervisor {other.pid}, since {other.started}, "
                f"{other.folder}): end it with ./elea down --port {port}, or take another port with --port"
            )
    return BadInput(f"port {port} of 127.0.0.1 is held by another program: take another one with --port")
