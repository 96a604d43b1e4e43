"""Its loop never returns from a computation."""

from __future__ import annotations

from services.runtime import main
from tests.faults.services.faulty_controller import faulty_controller


def fail() -> None:
    while True:
        pass


main(faulty_controller("spin", fail))
