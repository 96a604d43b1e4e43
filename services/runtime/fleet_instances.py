"""Which fleets run on this machine: one file each, locked by its supervisor as long as it lives.

The lock, not the number in the file, says that a fleet runs: the kernel lifts it with the process, however it dies, so
a number that another process got later is never taken for a supervisor.
"""

from __future__ import annotations

import fcntl
from collections.abc import Iterable

import msgspec

from messages.base import DECODE_ERRORS
from services.runtime.user_folders import instances_folder


class FleetInstance(msgspec.Struct, frozen=True, kw_only=True):
    """A fleet that runs: what its files, its supervisor and its router are called; ``saved`` are its parameters.

    ``router`` is the endpoint for this user's processes, ``listen`` are those for others.
    """

    fleet: str
    mode: str
    port: int
    pid: int
    folder: str
    started: str
    domain: str = ""
    router: str = ""
    listen: tuple[str, ...] = ()
    root: str = ""
    saved: str = ""


def running_fleets() -> tuple[FleetInstance, ...]:
    """Every fleet of this user that runs now."""
    found = []
    for path in sorted(instances_folder().glob("*.json")):
        try:
            with path.open("rb") as file:
                if not is_locked(file.fileno()):
                    continue
                found.append(msgspec.json.decode(file.read(), type=FleetInstance))
        except (OSError, *DECODE_ERRORS):
            continue
    return tuple(found)


def latest() -> FleetInstance | None:
    """The fleet of this user that was started last, also when it has ended: its file stays until the next one on its
    port."""
    found = []
    for path in instances_folder().glob("*.json"):
        try:
            found.append((path.stat().st_mtime_ns, msgspec.json.decode(path.read_bytes(), type=FleetInstance)))
        except (OSError, *DECODE_ERRORS):
            continue
    return max(found, key=lambda each: each[0])[1] if found else None


def is_locked(descriptor: int) -> bool:
    """Whether another process has locked the open file for itself."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(descriptor, fcntl.LOCK_UN)
    return False


def describe_fleets(fleets: Iterable[FleetInstance]) -> str:
    """``bare (port 7447), two (port 7448, domain two)``."""
    return ", ".join(
        f"{each.fleet} (port {each.port}{f', domain {each.domain}' if each.domain else ''})" for each in fleets
    )
