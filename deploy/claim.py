"""A fleet's claim on its port: the file by which others see that it runs, locked as long as its supervisor lives."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from services.runtime.errors import BadInput
from services.runtime.fleets import Running, folder, held, latest, running
from services.runtime.network import sockets

__all__ = ["Running", "claim", "folder", "held", "latest", "running"]

_PATIENCE_S = 1.0
"""Others look at a lock for a moment; a claim waits so long [s] for them."""


@contextmanager
def claim(entry: Running) -> Iterator[None]:
    """Hold the port for this fleet; raises BadInput when another fleet, or another program, holds it.

    What killed processes of an earlier fleet left of their sockets is removed, and at the end what those of this one
    leave.
    """
    path = folder() / f"{entry.port}.json"
    meeting = sockets.path_of(entry.router or sockets.router_endpoint(entry.port)).parent
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise BadInput(
            f"{path} cannot be written ({error.strerror}): set XDG_STATE_HOME to a folder of yours"
        ) from None
    with os.fdopen(descriptor, "r+b") as file:
        if not _lock(file.fileno()):
            raise _taken(entry.port)
        sockets.secure(meeting)
        _check_free(entry, meeting)
        sockets.sweep(meeting)
        file.truncate(0)
        file.write(msgspec.json.encode(entry))
        file.flush()
        try:
            yield
        finally:
            sockets.sweep(meeting)


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


def _check_free(entry: Running, meeting: Path) -> None:
    """Raise BadInput unless the fleet's router can listen wherever it is to.

    Another program may take a place before the router does: the router then ends with status 75 and says so.
    """
    try:
        sockets.knock(sockets.router_in(meeting))
    except OSError:
        pass
    else:
        raise BadInput(
            f"a router that is no fleet's already listens in {meeting}: end it, or take another port with --port"
        )
    for each in entry.listen:
        host, _, port = each.partition("/")[2].rpartition(":")
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(
                host.strip("[]"), int(port), type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                why = f"port {port} of {host} is held by another program: take another one with"
                raise BadInput(f"{why} {'--port' if int(port) == entry.port else '--listen'}") from None
            raise BadInput(f"the router cannot listen on {each}: {error.strerror or error}") from None


def _taken(port: int) -> BadInput:
    for other in running():
        if other.port == port:
            return BadInput(
                f"port {port} is held by the fleet {other.fleet} (supervisor {other.pid}, since {other.started}, "
                f"{other.folder}): end it with ./elea down --port {port}, or take another port with --port"
            )
    return BadInput(f"{folder() / f'{port}.json'} is held by another program: take another port with --port")
