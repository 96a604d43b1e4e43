"""Its loop raises what nobody expects."""

from __future__ import annotations

from services.runtime import main
from tests.faults.services.full_speed import failing


def fail() -> None:
    raise ZeroDivisionError("planted in the loop")


main(failing("raise_in_loop", fail))
