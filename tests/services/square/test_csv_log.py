"""The CSV log: the tutorial's columns first, rows on disk at once, and a file of its own or none."""

from __future__ import annotations

import csv
import resource
import signal
from pathlib import Path

import pytest

from messages.se2 import Pose2
from services.runtime.errors import BadInput
from services.square.csv_log import COLUMNS, TUTORIAL_COLUMNS, CsvLog

SECOND = 1_000_000_000


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_its_columns_are_those_of_the_tutorial_and_then_more(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    with CsvLog(path) as record:
        record.add_row(0, Pose2(1, 0, 0), Pose2(0, 0, 0), Pose2(5, 6, 0), 0, "drive")
        assert path.read_text().splitlines()[0] == ",".join(COLUMNS)
        assert COLUMNS[:7] == TUTORIAL_COLUMNS
        (row,) = rows(path)
    assert row["desired_x"] == "1"
    assert row["doing"] == "drive"


def test_truth_is_told_in_the_frame_of_odometry(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    quarter = 1.5707963267948966
    with CsvLog(path) as record:
        record.add_row(0, Pose2(0, 0, 0), Pose2(0, 0, 0), Pose2(5, 6, quarter), 0, "drive")
        record.add_row(SECOND, Pose2(1, 0, 0), Pose2(0.99, 0.0, 0.01), Pose2(5, 6.97, quarter + 0.02), 0, "drive")
        record.add_row(2 * SECOND, Pose2(1, 0, 0), Pose2(0.99, 0.0, 0.01), None, 1, "turn")
    last = rows(path)[1]
    figures = [
        float(last[name]) for name in ("truth_x", "truth_y", "truth_yaw", "error", "error_yaw", "drift", "drift_yaw")
    ]
    assert figures == pytest.approx([0.97, 0.0, 0.02, 0.03, 0.02, 0.02, -0.01], abs=1e-9)
    assert [rows(path)[2][name] for name in ("truth_x", "error", "drift_yaw", "corner")] == ["", "", "", "1"]


def test_ten_rows_a_second_and_a_reset_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    with CsvLog(path) as record:
        for tick in range(100):
            record.add_row(tick * SECOND // 50, Pose2(0, 0), Pose2(0, 0), None, 0, "drive")
        assert len(rows(path)) == 20
        record.reset()
        record.add_row(0, Pose2(0, 0), Pose2(0, 0), None, 0, "drive")
        assert len(rows(path)) == 1


def test_what_an_earlier_run_left_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text("an old log that is far longer than the new one\n" * 50)
    with CsvLog(path):
        pass
    assert path.read_text() == ",".join(COLUMNS) + "\n"


def test_a_path_that_cannot_be_written_is_refused_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"cannot be written \(No such file.*\): choose another path with the parameter"):
        CsvLog(tmp_path / "missing" / "log.txt").__enter__()
    with pytest.raises(BadInput, match="is not a file: choose another path"):
        CsvLog(tmp_path).__enter__()


def test_two_squares_do_not_write_one_file(tmp_path: Path) -> None:
    with CsvLog(tmp_path / "log.txt") as first:
        first.add_row(0, Pose2(0, 0), Pose2(0, 0), None, 0, "drive")
        with pytest.raises(BadInput, match="another square"):
            CsvLog(tmp_path / "log.txt").__enter__()
        assert len(rows(tmp_path / "log.txt")) == 1


def test_a_full_disk_ends_the_log_and_nothing_else(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        with CsvLog(tmp_path / "log.txt") as record:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
            for tick in range(100):
                record.add_row(tick * SECOND, Pose2(0, 0), Pose2(0, 0), None, 0, "drive")
            assert record.error == "File too large"
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
        with pytest.raises(BadInput, match="cannot be written"):
            CsvLog(tmp_path / "other.txt").__enter__()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    assert len((tmp_path / "log.txt").read_text()) == 1000
