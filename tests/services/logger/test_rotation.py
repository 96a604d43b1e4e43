"""A recording from before a crash of the logger is kept beside the one after."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.run_folder import make_run_folder
from services.logger import SERVICE
from services.logger.file_rotation import rotate, rotated
from services.runtime.errors import BadInput
from services.runtime.testing import run_service
from tests.harness.ports import free_port
from tests.services.logger.recording_reader import poses
from tests.services.logger.synthetic_drive import SyntheticRobot
from tests.services.logger.test_loop import drive, settings


def recorded(file: Path) -> int:
    times, _ = poses(file, "tb3_0", "base_footprint")
    return len(times)


def test_a_logger_that_is_started_again_keeps_what_was_recorded_before(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    for end in (2.0, 1.0):
        with run_service(SERVICE, "/", settings(file, free_port())) as bench:
            bench.set_time(0.0)
            drive(bench, SyntheticRobot(y0=0.0), end)
    assert "it is kept as run-1.rrd" in bench.log
    assert rotated(file) == [tmp_path / "run-1.rrd"]
    assert (recorded(tmp_path / "run-1.rrd"), recorded(file)) == (100, 50)


def test_each_life_gets_a_file_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    assert rotate(file) is None
    (tmp_path / "run-arm.rrd").write_text("of somebody else")
    for number in range(1, 12):
        file.write_text(str(number))
        assert rotate(file) == tmp_path / f"run-{number}.rrd"
    assert [each.read_text() for each in rotated(file)] == [str(number) for number in range(1, 12)]
    file.touch()
    assert rotate(file) is None, "an empty file holds nothing to keep"


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(self: Path, target: Path) -> Path:
        raise OSError(30, "Read-only file system")

    file = tmp_path / "run.rrd"
    file.write_text("x")
    monkeypatch.setattr(Path, "rename", refused)
    with pytest.raises(BadInput, match=r"cannot be written.*Read-only"):
        rotate(file)


def test_a_new_run_in_an_old_folder_begins_without_its_recordings(tmp_path: Path) -> None:
    for name in ("run.rrd", "run-1.rrd", "notes.rrd"):
        (tmp_path / name).write_text("old")
    make_run_folder("lab", str(tmp_path))
    assert sorted(each.name for each in tmp_path.glob("*.rrd")) == ["notes.rrd"]
