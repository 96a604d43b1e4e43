"""Locks that only one fleet can hold: its port, and its file of saved parameters."""

from __future__ import annotations

import errno
import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from services.runtime.errors import BadInput
from services.runtime.fleet_instances import FleetInstance, is_locked, running_fleets
from services.runtime.ports import bind_error
from services.runtime.transport import unix_sockets
from services.runtime.user_folders import instances_folder

_LOCK_TIMEOUT_S = 1.0
"""Wall time [s] to wait for a lock, which other processes briefly hold to test it."""


@contextmanager
def instance_lock(entry: FleetInstance) -> Iterator[None]:
    """Hold the port for this fleet; raises BadInput if another fleet or program holds it.

    Removes sockets left by killed processes of an earlier fleet, and at the end those of this one.
    """
    path = instances_folder() / f"{entry.port}.json"
    sockets = unix_sockets.path_of(entry.router or unix_sockets.router_endpoint(entry.port)).parent
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise BadInput(f"{path} cannot be written ({error.strerror}): set ELEA_HOME to a folder of your own") from None
    with os.fdopen(descriptor, "r+b") as file:
        if not _lock(file.fileno()):
            raise _port_in_use(entry.port)
        unix_sockets.make_private(sockets)
        _check_free(entry, sockets)
        unix_sockets.remove_stale(sockets)
        file.truncate(0)
        file.write(msgspec.json.encode(entry))
        file.flush()
        try:
            yield
        finally:
            unix_sockets.remove_stale(sockets)


def _lock(descriptor: int) -> bool:
    deadline = time.monotonic() + _LOCK_TIMEOUT_S
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.02)


def _check_free(entry: FleetInstance, sockets: Path) -> None:
    """Raise BadInput unless the fleet's router can listen at all its endpoints.

    Another program may still take one before the router does: the router then exits with status 75 and reports it.
    """
    try:
        unix_sockets.check_reachable(unix_sockets.router_in(sockets))
    except OSError:
        pass
    else:
        raise BadInput(
            f"a router that belongs to no fleet already listens in {sockets}: stop it, or choose another --port"
        )
    for each in entry.listen:
        host, _, port = each.partition("/")[2].rpartition(":")
        if (error := bind_error(int(port), host.strip("[]"))) is None:
            continue
        if error.errno == errno.EADDRINUSE:
            flag = "--port" if int(port) == entry.port else "--listen"
            raise BadInput(f"port {port} of {host} is held by another program: choose another one with {flag}")
        raise BadInput(f"the router cannot listen on {each}: {error.strerror or error}")


def _port_in_use(port: int) -> BadInput:
    for other in running_fleets():
        if other.port == port:
            return BadInput(
                f"port {port} is held by the fleet {other.fleet} (supervisor {other.pid}, since {other.started}, "
                f"{other.folder}): stop it with ./elea down --port {port}, or take another port with --port"
            )
    return BadInput(f"{instances_folder() / f'{port}.json'} is held by another program: take another port with --port")


_RELEASE_TIMEOUT_S = 2.0
"""Wall time [s] for a parameter service to exit and release its file after its supervisor was killed."""


def check_parameter_file_unused(file: Path) -> None:
    """Raise BadInput if the parameter service of another fleet holds the file; a missing file is unused."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return  # the parameter service reports the problem
    try:
        deadline = time.monotonic() + _RELEASE_TIMEOUT_S
        while is_locked(descriptor):
            if time.monotonic() > deadline:
                raise BadInput(_parameter_file_in_use(file))
            time.sleep(0.05)
    finally:
        os.close(descriptor)


def _parameter_file_in_use(file: Path) -> str:
    others = [each for each in running_fleets() if each.pid != os.getpid() and each.saved and Path(each.saved) == file]
    holder = f"the fleet {others[0].fleet} (port {others[0].port})" if others else "another parameter service"
    end = f"stop it with ./elea down --port {others[0].port}, " if others else ""
    return (
        f"{holder} uses the file of parameters {file}, which only one fleet can write: {end}"
        "give this fleet a file of its own with --params FILE, or --no-saved to save nothing"
    )
