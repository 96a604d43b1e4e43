"""Its loop never comes back from a calculation."""

from __future__ import annotations

from services.runtime import main
from tests.faults.services.full_speed import failing


def fail() -> None:
    while True:
        pass


main(failing("spin", fail))
