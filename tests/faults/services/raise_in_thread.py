"""Raises in one of its threads, while its loop could continue."""

from __future__ import annotations

import threading

from services.runtime import main
from tests.faults.services.faulty_controller import faulty_controller


def work() -> None:
    raise ZeroDivisionError("planted in the thread")


main(faulty_controller("raise_in_thread", threading.Thread(target=work).start))
