"""The log of a square: the tutorial's CSV columns, and beside them truth and errors; each row is flushed."""

from __future__ import annotations

import fcntl
import math
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from services.motion.planar import Placement, Planar, wrap
from services.runtime.errors import BadInput

SEED_COLUMNS = ("time", "desired_x", "desired_y", "desired_yaw", "actual_x", "actual_y", "actual_yaw")
COLUMNS = (
    *SEED_COLUMNS,
    *("truth_x", "truth_y", "truth_yaw", "error", "error_yaw", "drift", "drift_yaw", "corner", "doing"),
)
"""s, m, rad in the frame of odometry. ``error`` is the distance of the truth from the desired position, ``drift`` that
of odometry from the truth; ``error_yaw`` and ``drift_yaw`` are truth minus desired and odometry minus truth."""
PERIOD_NS = 100_000_000
"""Between two rows, ns: the tutorial's rate."""


class Record:
    """Opened by ``with``: whoever holds the file has it alone. Raises BadInput when it cannot be written.

    ``trouble`` is None until a row cannot be written, as on a full disk; then it says why, and no more are tried.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.trouble: str | None = None
        self._file: TextIO | None = None
        self._row = -1
        self._placed: Placement | None = None

    def __enter__(self) -> Record:
        try:
            if self.path.exists() and not self.path.is_file():
                raise BadInput(f"the log {self.path} is no file: choose another path with the parameter log")
            self._file = self.path.open("a", encoding="utf-8", newline="")
        except OSError as error:
            raise self._unwritable(error.strerror) from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise BadInput(
                f"the log {self.path} is being written by another square: "
                "give this one another path with the parameter log"
            ) from None
        self.restart()
        if self.trouble is not None:
            self.__exit__()
            raise self._unwritable(self.trouble)
        return self

    def __exit__(self, *exception: object) -> None:
        # What could not be flushed was told when it was written.
        with suppress(OSError):
            if self._file is not None:
                self._file.close()

    def restart(self) -> None:
        """Begin the file anew, as simulation time does."""
        assert self._file is not None
        self._row, self._placed = -1, None
        try:
            self._file.seek(0)
            self._file.truncate()
        except OSError as error:
            self.trouble = str(error.strerror)
        self._write(COLUMNS)

    def add(self, time: int, desired: Planar, actual: Planar, truth: Planar | None, corner: int, doing: str) -> None:
        """Write the row of ``time`` [ns] unless there is one of this tenth of a second.

        ``truth`` is told in the world; its frame is laid over that of odometry where both are first known.
        """
        if time // PERIOD_NS == self._row:
            return
        self._row = time // PERIOD_NS
        if truth is not None and self._placed is None:
            self._placed = Placement.of(actual, truth)
        numbers = [time / 1e9, desired.x, desired.y, desired.yaw, actual.x, actual.y, actual.yaw]
        cells = [repr(each) for each in numbers]
        cells += [""] * 7 if truth is None or self._placed is None else _compared(desired, actual, self._placed, truth)
        self._write((*cells, str(corner), doing))

    def _write(self, cells: tuple[str, ...]) -> None:
        assert self._file is not None
        if self.trouble is not None:
            return
        try:
            self._file.write(",".join(cells) + "\n")
            self._file.flush()
        except OSError as error:
            self.trouble = str(error.strerror)

    def _unwritable(self, reason: str | None) -> BadInput:
        return BadInput(
            f"the log {self.path} cannot be written ({reason}): "
            "choose another path with the parameter log, or none with log="
        )


def _compared(desired: Planar, actual: Planar, placed: Placement, truth: Planar) -> list[str]:
    true = placed.apply(truth)
    figures = (
        true.x,
        true.y,
        wrap(true.yaw),
        math.hypot(true.x - desired.x, true.y - desired.y),
        wrap(true.yaw - desired.yaw),
        math.hypot(actual.x - true.x, actual.y - true.y),
        wrap(actual.yaw - true.yaw),
    )
    return [repr(each) for each in figures]
