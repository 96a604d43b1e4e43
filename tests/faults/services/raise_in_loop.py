"""Raises an unexpected exception in its loop."""

from __future__ import annotations

from services.runtime import main
from tests.faults.services.faulty_controller import faulty_controller


def fail() -> None:
    raise ZeroDivisionError("planted in the loop")


main(faulty_controller("raise_in_loop", fail))
