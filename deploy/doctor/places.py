"""Where Elea writes: results and state."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from deploy.claim import folder
from deploy.doctor import Finding, fail, ok, warn
from deploy.run_folder import RUNS

SCANT_MIB, NONE_MIB = 2048, 64
"""Free space: an hour of a recorded lab takes about 1 GiB."""


def results(runs: Path = RUNS) -> Iterator[Finding]:
    """The folder of the runs can be written, and there is room."""
    yield from _writable("run folder", runs, "choose another with ./elea up --report DIR, or mend its rights: chown")


def state() -> Iterator[Finding]:
    """The folder that says which fleets run can be written."""
    yield from _writable("state folder", folder(), "set XDG_STATE_HOME to a folder of yours")


def _writable(name: str, path: Path, do: str) -> Iterator[Finding]:
    there = next(each for each in (path, *path.parents) if each.exists())
    try:
        with tempfile.TemporaryFile(dir=there) as file:
            file.write(b"elea")
        free = shutil.disk_usage(there).free
    except OSError as error:
        yield fail(name, f"{path} cannot be written: {error.strerror}", do)
        return
    yield room(name, path, free)


def room(name: str, path: Path, free: int) -> Finding:
    """Whether ``free`` bytes are room enough on the disk of ``path``."""
    mib = free // 2**20
    if mib < NONE_MIB:
        return fail(name, f"{path}: {mib} MiB are free", "make room on this disk: runs/ holds old recordings")
    if mib < SCANT_MIB:
        return warn(name, f"{path}: {mib} MiB are free", "make room on this disk: runs/ holds old recordings")
    return ok(name, f"{path}, {mib / 1024:.0f} GiB free")
