"""The file of saved parameters belongs to one fleet at a time: who else uses it is told before anything starts."""

from __future__ import annotations

import os
import time
from pathlib import Path

from deploy.claim import held, running
from services.runtime.errors import BadInput

_PATIENCE_S = 2.0
"""A parameter service whose supervisor was killed takes a moment to end and let its file go [s]."""


def check_unused(file: Path) -> None:
    """Raise BadInput when the parameter service of another fleet holds the file; one that is not there is free."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return  # whatever is wrong with it, the parameter service says
    try:
        deadline = time.monotonic() + _PATIENCE_S
        while held(descriptor):
            if time.monotonic() > deadline:
                raise BadInput(_used(file))
            time.sleep(0.05)
    finally:
        os.close(descriptor)


def _used(file: Path) -> str:
    others = [each for each in running() if each.pid != os.getpid() and each.saved and Path(each.saved) == file]
    who = f"the fleet {others[0].fleet} (port {others[0].port})" if others else "another parameter service"
    end = f"end it with ./elea down --port {others[0].port}, " if others else ""
    return (
        f"{who} uses the file of parameters {file}, which one fleet alone can write: {end}"
        "give this fleet a file of its own with --params FILE, or --no-saved to save nothing"
    )
