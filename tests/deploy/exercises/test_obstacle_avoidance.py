"""The exercise as a student gets it: created by a command, failed by its stub, passed by a solution."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from deploy.exercises import EXERCISES, make_exercise
from services.runtime.errors import BadInput
from services.runtime.process import ROOT
from tests.harness.command_line import CommandLine


@pytest.fixture
def exercise(tmp_path: Path) -> CommandLine:
    """A student's working directory with the exercise ``avoid``."""
    made = CommandLine(tmp_path)
    done = made.run("new", "exercise", "avoid")
    assert (done.status, done.out) == (0, "avoid is ready: read its README.md, then ./elea up avoid/fleet.toml\n")
    return made


def test_the_stub_fails_and_the_report_says_why(exercise: CommandLine) -> None:
    done = exercise.run_fleet("avoid/fleet.toml", exercise.folder / "run", "--duration", "10", "--json", "--no-saved")
    assert done.status == 1, done.err
    report = json.loads(done.out)
    missed = {each["name"]: each["value"] for each in report["checks"] if not each["ok"]}
    assert missed.keys() == {f"burger.{each}" for each in ("points_reached", "collisions", "min_clearance_m", "time_s")}
    assert report["robots"]["burger"]["min_clearance_to"] == "crate"


def test_a_solution_passes_the_test_that_grades_it(exercise: CommandLine) -> None:
    folder = exercise.folder / "avoid"
    shutil.copy(Path(__file__).with_name("avoidance_solution.py"), folder / "controller.py")
    command = [ROOT / "elea", "test", folder / "test_exercise.py"]
    done = subprocess.run(command, env=exercise.environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout


def test_bad_names_make_nothing(tmp_path: Path) -> None:
    for name, kind, reason in (
        ("a/b", EXERCISES[0], "is a path"),
        ("9lives", EXERCISES[0], "9lives"),
        ("avoid", "obstacle_avoidence", "did you mean 'obstacle_avoidance'"),
    ):
        with pytest.raises(BadInput, match=reason):
            make_exercise(name, kind, tmp_path)
    (tmp_path / "avoid").mkdir()
    with pytest.raises(BadInput, match="exists already"):
        make_exercise("avoid", EXERCISES[0], tmp_path)
    with pytest.raises(BadInput, match="cannot be made"):
        make_exercise("avoid", EXERCISES[0], tmp_path / "nowhere")
    assert [each.name for each in tmp_path.iterdir()] == ["avoid"]
    assert list((tmp_path / "avoid").iterdir()) == []
