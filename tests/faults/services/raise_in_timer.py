"""Raises in a timer, while its loop could continue."""

from __future__ import annotations

import threading

from services.runtime import main
from tests.faults.services.faulty_controller import faulty_controller


def ring() -> None:
    raise ZeroDivisionError("planted in the timer")


main(faulty_controller("raise_in_timer", lambda: threading.Timer(0.02, ring).start()))
