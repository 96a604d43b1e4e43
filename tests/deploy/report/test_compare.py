"""``elea diff``: two real runs that are identical, one that differs, planted differences and bad input."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deploy.report.compare import compare_runs
from messages.cdr.write import writer
from messages.geometry import Twist
from services.bag.reader import open_bag
from services.bag.writer import BagWriter
from services.grader.records import MEASUREMENTS_FILE, ROBOT_TRAIL_COLUMNS, TRAJECTORIES_FILE
from tests.deploy.report.test_report import put_run
from tests.harness.command_line import CommandLine
from tests.services.bag.sample_bags import write_messages

FLEET = """
name = "one"
[run]
ends = "duration"
duration = 2
[[robot]]
name = "r"
model = "burger"
services = [{{ kind = "waypoint", parameters = {{ goals = [[1, 0]], max_linear = {speed} }} }}]
"""


class Runs:
    """Two recorded runs of one fleet, a third with another speed, and the command line."""

    def __init__(self, folder: Path) -> None:
        self.terminal = CommandLine(folder)
        self.left, self.right, self.slower = (folder / name for name in ("left", "right", "slower"))
        started = []
        for results, speed in ((self.left, 0.2), (self.right, 0.2), (self.slower, 0.1)):
            fleet = folder / f"{results.name}.toml"
            fleet.write_text(FLEET.format(speed=speed))
            terminal = CommandLine(folder)
            started.append((terminal, terminal.start_fleet(fleet, results, "--record", "--no-saved"), results))
        for terminal, process, results in started:
            ran = terminal.finish(process)
            assert (results / MEASUREMENTS_FILE).is_file(), ran.err

    def diff(self, left: Path, right: Path) -> tuple[int, str, dict[str, Any]]:
        """Run ``elea diff``; return its exit status, text and JSON output."""
        text = self.terminal.run("diff", str(left), str(right))
        data = self.terminal.run("diff", str(left), str(right), "--json")
        assert text.status == data.status
        return text.status, text.out, json.loads(data.out) if data.out else {}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


def test_two_lockstep_runs_are_the_same(runs: Runs) -> None:
    status, text, data = runs.diff(runs.left, runs.right)
    assert status == 0, text
    assert text.startswith("the runs are the same: ")
    assert data["same"] is True
    assert data["hashes"][0] == data["hashes"][1]
    assert data["messages"]["messages"] > 500
    assert data["notes"] == []


def test_a_run_with_another_parameter_differs_from_its_first_command_on(runs: Runs) -> None:
    status, text, data = runs.diff(runs.left, runs.slower)
    assert status == 1
    assert data["trajectory"]["robot"] == "r"
    assert data["messages"]["difference"]["topic"] == "/r/waypoint/parameter_updates"
    assert data["notes"] == [f"parameter /r/waypoint max_linear: 0.2 in {runs.left}, 0.1 in {runs.slower}"]
    assert "r first differs at t = " in text


def planted(runs: Runs, folder: Path, change: Callable[[Path], None]) -> Path:
    """Return a copy of the right-hand run with a change."""
    shutil.copytree(runs.right, folder)
    change(folder)
    return folder


def test_a_planted_sample_is_found(runs: Runs, tmp_path: Path) -> None:
    def change(run: Path) -> None:
        with np.load(run / TRAJECTORIES_FILE) as arrays:
            kept = dict(arrays)
        kept["r.trail"][20, ROBOT_TRAIL_COLUMNS.index("y")] += 1e-12
        np.savez_compressed(run / TRAJECTORIES_FILE, **kept)

    status, text, data = runs.diff(runs.left, planted(runs, tmp_path / "run", change))
    with np.load(runs.left / TRAJECTORIES_FILE) as arrays:
        time = float(arrays["r.trail"][20, 0])
    assert status == 1
    assert (data["trajectory"]["robot"], data["trajectory"]["column"]) == ("r", "y")
    assert data["trajectory"]["time_s"] == time
    assert f"r first differs at t = {time:.9g} s (tick {round(time * 200)}): y " in text


def test_a_planted_command_is_found(runs: Runs, tmp_path: Path) -> None:
    def change(run: Path) -> None:
        entries = list(open_bag(run / "bag").entries())
        at = [index for index, entry in enumerate(entries) if entry.channel.name == "/r/cmd_vel"][10]
        entries[at] = entries[at]._replace(data=writer(Twist)(Twist.planar(0.5, 0.0)))
        shutil.rmtree(run / "bag")
        with BagWriter(run / "bag") as bag:
            for entry in entries:
                bag.write(*entry)

    status, text, data = runs.diff(runs.left, planted(runs, tmp_path / "run", change))
    found = data["messages"]["difference"]
    assert status == 1
    assert data["trajectory"] is None
    assert (found["topic"], found["number"], found["field"], found["right"]) == ("/r/cmd_vel", 11, "linear.x", 0.5)
    assert "/r/cmd_vel first differs at t = " in text
    status, _, data = runs.diff(runs.left / "bag", tmp_path / "run" / "bag")
    assert (status, data["messages"]["difference"]) == (1, found)


def test_a_planted_hash_is_found(runs: Runs, tmp_path: Path) -> None:
    def change(run: Path) -> None:
        measured = json.loads((run / MEASUREMENTS_FILE).read_text())
        (run / MEASUREMENTS_FILE).write_text(json.dumps({**measured, "trajectory_hash": "0" * 64}))

    status, text, data = runs.diff(runs.left, planted(runs, tmp_path / "run", change))
    assert status == 1
    assert data["trajectory"] is None
    assert "note: the hashes differ, but trajectories.npz does not" in text


def test_a_run_that_ended_earlier_is_the_same_up_to_there(tmp_path: Path) -> None:
    whole, cut = put_run(tmp_path / "whole"), put_run(tmp_path / "cut", end=10.0, ended="stopped")
    found = compare_runs(whole, cut)
    assert not found.same
    assert found.trajectory is not None
    assert (found.trajectory.column, found.trajectory.right) == ("", None)
    assert 9.9 < found.trajectory.time_s < 10.1


def test_a_bag_that_lacks_messages_is_named(tmp_path: Path) -> None:
    for name, lost in (("whole", "{}"), ("gaps", '{"/odom": 2, "/plan": 1}')):
        with BagWriter(tmp_path / name) as bag:
            write_messages(bag, [("/twist", Twist.planar(float(name == "gaps"), 0.0), 0)])
            bag.metadata["lost"] = lost
    (note,) = compare_runs(tmp_path / "whole", tmp_path / "gaps").notes
    assert f"{tmp_path / 'gaps'} lacks 3 messages that were lost on their way to the recorder, of /odom, /plan" in note


def test_bad_input_is_refused_with_its_reason(runs: Runs, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    damaged = planted(runs, tmp_path / "run", lambda run: (run / TRAJECTORIES_FILE).write_bytes(b"PK nothing") and None)
    for other, reason in (
        (tmp_path / "none", "there is no run"),
        (tmp_path / "empty", "has no measurements.json"),
        (runs.left / "bag", "has no measurements.json"),
        (damaged, "cannot be read"),
    ):
        ran = runs.terminal.run("diff", str(runs.left), str(other))
        assert ran.status == 2, (other, ran)
        assert reason in ran.err
    assert runs.terminal.run("diff", str(tmp_path / "empty"), str(tmp_path / "empty")).status == 2
