"""Its loop waits for a lock that it holds itself."""

from __future__ import annotations

import threading

from services.runtime import main
from tests.faults.services.full_speed import failing


def fail() -> None:
    lock = threading.Lock()
    lock.acquire()
    lock.acquire()


main(failing("deadlock", fail))
