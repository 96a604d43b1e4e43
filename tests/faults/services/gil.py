"""Foreign code holds the interpreter's lock: no Python thread of the process runs any more."""

from __future__ import annotations

import ctypes

from services.runtime import main
from tests.faults.services.full_speed import failing


def fail() -> None:
    ctypes.PyDLL(None).sleep(1000)


main(failing("gil", fail))
