"""CSV files of references: accepted notations, and errors with line and reason."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from services.reference.waveforms import read_table
from services.runtime.errors import BadInput


@pytest.mark.parametrize(
    "text",
    [
        "0,1\n1,2\n",
        "time,degrees\n0,1\n1,2\n",
        "\ufeff0;1\n1;2",
        "# by hand\n\n0 1  # a start\n1\t2\n",
        "0 , 1\r\n1 , 2\r\n",
    ],
)
def test_rows_in_any_of_the_usual_ways(tmp_path: Path, text: str) -> None:
    file = tmp_path / "way.csv"
    file.write_bytes(text.encode())
    table = read_table(file)
    assert (table.times, table.angles) == ([0.0, 1.0], [1.0, 2.0])


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("0,1\n1\n", 2, "1 values, a row has two"),
        ("0,1,2\n", 1, "3 values, a row has two"),
        ("0,1\nsoon,2\n", 2, "'soon 2' is not two numbers"),
        ("time,5\n", 1, "'time 5' is not two numbers"),
        ("0,1\n0,2\n", 2, "is not after 0 s: times must increase"),
        ("-1,2\n", 1, "the time -1 s must be finite and at least 0"),
        ("nan,2\n", 1, "the time nan s must be finite"),
        ("0,nan\n", 1, "the angle nan deg must be within"),
        ("0,inf\n", 1, "the angle inf deg must be within"),
        ("0,1e9\n", 1, "must be within +-360000 deg"),
    ],
)
def test_a_bad_row_is_told_with_its_line(tmp_path: Path, text: str, line: int, reason: str) -> None:
    file = tmp_path / "way.csv"
    file.write_text(text)
    with pytest.raises(BadInput) as refused:
        read_table(file)
    assert str(refused.value).startswith(f"{file}:{line}: ")
    assert reason in str(refused.value)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_table(tmp_path / "absent.csv")
    (tmp_path / "empty.csv").write_text("time,degrees\n")
    with pytest.raises(BadInput, match="there is no row"):
        read_table(tmp_path / "empty.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="cannot be read"):
        read_table(tmp_path / "binary.csv")


def test_a_pipe_is_no_file_and_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(BadInput, match="cannot be read: it is not a file"):
            read_table(path)
