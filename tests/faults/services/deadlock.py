"""Deadlocks: its loop waits for a lock that it holds itself."""

from __future__ import annotations

import threading

from services.runtime import main
from tests.faults.services.faulty_controller import faulty_controller


def fail() -> None:
    lock = threading.Lock()
    lock.acquire()
    lock.acquire()


main(faulty_controller("deadlock", fail))
