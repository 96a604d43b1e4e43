"""A timer that it has set raises, while its loop would go on."""

from __future__ import annotations

import threading

from services.runtime import main
from tests.faults.services.full_speed import failing


def ring() -> None:
    raise ZeroDivisionError("planted in the timer")


main(failing("raise_in_timer", lambda: threading.Timer(0.02, ring).start()))
