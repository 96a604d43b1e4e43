"""The fleets running on this machine: one file each, locked by its supervisor as long as it lives.

The lock, not the process id in the file, shows that a fleet runs: the kernel releases it when the process ends, however
that happens, so another process that later gets the same id is never mistaken for the supervisor.
"""

from __future__ import annotations

import fcntl
from collections.abc import Iterable

import msgspec

from messages.base import DECODE_ERRORS
from services.runtime.user_folders import instances_folder


class FleetInstance(msgspec.Struct, frozen=True, kw_only=True):
    """A running fleet: its folder, supervisor (``pid``) and router; ``saved`` is the place of its saved parameters.

    ``router`` is the endpoint for this user's processes, ``listen`` has those for others.
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
    """Return all running fleets of this user."""
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
    """Return the fleet that this user started last, even if it has ended: its file stays until the next fleet on its
    port starts."""
    found = []
    for path in instances_folder().glob("*.json"):
        try:
            found.append((path.stat().st_mtime_ns, msgspec.json.decode(path.read_bytes(), type=FleetInstance)))
        except (OSError, *DECODE_ERRORS):
            continue
    return max(found, key=lambda each: each[0])[1] if found else None


def is_locked(descriptor: int) -> bool:
    """Return whether another process holds an exclusive lock on the open file."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(descriptor, fcntl.LOCK_UN)
    return False


def describe_fleets(fleets: Iterable[FleetInstance]) -> str:
    """Format fleets as ``bare (port 7447), two (port 7448, domain two)``."""
    return ", ".join(
        f"{each.fleet} (port {each.port}{f', domain {each.domain}' if each.domain else ''})" for each in fleets
    )
