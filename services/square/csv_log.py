"""The CSV log of a square: the tutorial's columns, ground truth and errors; each row is flushed."""

from __future__ import annotations

import fcntl
import math
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from messages.se2 import Pose2, wrap
from services.runtime.errors import BadInput

MAX_SAMPLES = 64
"""Maximum number of samples kept, which covers more than a second."""


class TruthBuffer:
    """The newest MAX_SAMPLES true poses by stamp."""

    def __init__(self) -> None:
        self._poses: dict[int, Pose2] = {}

    def add(self, stamp: int, pose: Pose2) -> None:
        """Add the pose at a stamp [ns]."""
        self._poses[stamp] = pose
        if len(self._poses) > MAX_SAMPLES:
            del self._poses[next(iter(self._poses))]

    def at(self, stamp: int) -> Pose2 | None:
        """Return the pose at exactly this stamp [ns], if still known."""
        return self._poses.get(stamp)


TUTORIAL_COLUMNS = ("time", "desired_x", "desired_y", "desired_yaw", "actual_x", "actual_y", "actual_yaw")
COLUMNS = (
    *TUTORIAL_COLUMNS,
    *("truth_x", "truth_y", "truth_yaw", "error", "error_yaw", "drift", "drift_yaw", "corner", "doing"),
)
"""Columns in s, m, rad, in the odom frame. ``error`` is the distance between true and desired position, ``drift``
between odometry and truth; ``error_yaw`` and ``drift_yaw`` are truth minus desired and odometry minus truth."""
PERIOD_NS = 100_000_000
"""Time between two rows [ns]: the tutorial's rate."""


class CsvLog:
    """The log file, opened and locked by ``with``; raises BadInput if it cannot be written.

    ``error`` is None until a row cannot be written, e.g. on a full disk; then it is the reason, and logging stops.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.error: str | None = None
        self._file: TextIO | None = None
        self._row = -1
        self._truth_to_odom: Pose2 | None = None

    def __enter__(self) -> CsvLog:
        try:
            if self.path.exists() and not self.path.is_file():
                raise BadInput(f"the log {self.path} is not a file: choose another path with the parameter log")
            self._file = self.path.open("a", encoding="utf-8", newline="")
        except OSError as error:
            raise self._write_error(error.strerror) from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise BadInput(
                f"the log {self.path} is being written by another square: "
                "give this one another path with the parameter log"
            ) from None
        self.reset()
        if self.error is not None:
            self.__exit__()
            raise self._write_error(self.error)
        return self

    def __exit__(self, *exception: object) -> None:
        # A failed flush was already reported.
        with suppress(OSError):
            if self._file is not None:
                self._file.close()

    def reset(self) -> None:
        """Truncate the file, after a reset of simulation time."""
        assert self._file is not None
        self._row, self._truth_to_odom = -1, None
        try:
            self._file.seek(0)
            self._file.truncate()
        except OSError as error:
            self.error = str(error.strerror)
        self._write(COLUMNS)

    def add_row(self, time: int, desired: Pose2, actual: Pose2, truth: Pose2 | None, corner: int, phase: str) -> None:
        """Write a row, at most one per tenth of a second.

        Args:
            time: Simulation time [ns].
            desired: Desired pose in the odom frame.
            actual: Pose by odometry.
            truth: True pose in the world frame, if known; the first one is aligned with odometry.
            corner: Index of the corner that the robot drives to.
            phase: Phase of the control law.
        """
        if time // PERIOD_NS == self._row:
            return
        self._row = time // PERIOD_NS
        if truth is not None and self._truth_to_odom is None:
            self._truth_to_odom = Pose2.aligning(actual, truth)
        numbers = [time / 1e9, desired.x, desired.y, desired.yaw, actual.x, actual.y, actual.yaw]
        cells = [repr(each) for each in numbers]
        cells += (
            [""] * 7
            if truth is None or self._truth_to_odom is None
            else _error_columns(desired, actual, self._truth_to_odom, truth)
        )
        self._write((*cells, str(corner), phase))

    def _write(self, cells: tuple[str, ...]) -> None:
        assert self._file is not None
        if self.error is not None:
            return
        try:
            self._file.write(",".join(cells) + "\n")
            self._file.flush()
        except OSError as error:
            self.error = str(error.strerror)

    def _write_error(self, reason: str | None) -> BadInput:
        return BadInput(
            f"the log {self.path} cannot be written ({reason}): "
            "choose another path with the parameter log, or none with log="
        )


def _error_columns(desired: Pose2, actual: Pose2, truth_to_odom: Pose2, truth: Pose2) -> list[str]:
    true = truth_to_odom @ truth
    columns = (
        true.x,
        true.y,
        wrap(true.yaw),
        math.hypot(true.x - desired.x, true.y - desired.y),
        wrap(true.yaw - desired.yaw),
        math.hypot(actual.x - true.x, actual.y - true.y),
        wrap(actual.yaw - true.yaw),
    )
    return [repr(each) for each in columns]
