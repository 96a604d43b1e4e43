"""A thread of its own dies, while its loop would go on."""

from __future__ import annotations

import threading

from services.runtime import main
from tests.faults.services.full_speed import failing


def work() -> None:
    raise ZeroDivisionError("planted in the thread")


main(failing("raise_in_thread", threading.Thread(target=work).start))
