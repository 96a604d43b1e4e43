"""What an earlier run left behind: processes without a supervisor."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import pairwise

from deploy.claim import running
from deploy.doctor import Finding, ok, warn
from deploy.doctor.running import disk

ADOPTERS = ("systemd", "init")
"""Who takes over a process whose parent has died, besides process 1."""


def processes() -> Iterator[Finding]:
    """Services of this user that no supervisor and no terminal has any more."""
    import psutil

    supervisors = {each.pid for each in running()}
    left, run = [], 0
    for process in psutil.process_iter(["pid", "cmdline", "uids"]):
        words = process.info["cmdline"] or []
        module = next((word for before, word in pairwise(words) if before == "-m"), "")
        uids = process.info["uids"]
        if not module.startswith("services.") or uids is None or uids.real != os.getuid():
            continue
        try:
            line = process.parents()
            orphan = not line or line[0].pid == 1 or line[0].name() in ADOPTERS
        except psutil.Error:
            continue
        run += 1
        if orphan and not supervisors & {each.pid for each in line}:
            left.append(f"{module} ({process.info['pid']})")
    if left:
        yield warn(
            "processes",
            f"without a supervisor: {', '.join(sorted(left)[:10])}",
            "if you did not start them on purpose, end them: kill PID",
        )
    else:
        yield ok(
            "processes", f"{run} services run, each below a supervisor or a terminal" if run else "none is left over"
        )


def fleets() -> Iterator[Finding]:
    """The fleets that run."""
    for each in running():
        yield ok("fleet", f"{each.fleet} ({each.mode}) on port {each.port}, supervisor {each.pid}, {each.folder}")
        yield from disk(each.fleet, each.folder)
