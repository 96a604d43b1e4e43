"""Foreign code holds the GIL, so no Python thread of the process runs."""

from __future__ import annotations

import ctypes

from services.runtime import main
from tests.faults.services.faulty_controller import faulty_controller


def fail() -> None:
    ctypes.PyDLL(None).sleep(1000)


main(faulty_controller("gil", fail))
