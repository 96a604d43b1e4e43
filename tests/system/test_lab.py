"""The main use case as a whole: the lab fleet from the command line, its report, repeatability and recording."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import jsonschema
import matplotlib.image
import numpy as np
import pytest

from deploy.report.record import SCHEMA_FILE
from models.palette import colours
from services.logger.screenshots import Screenshot, screenshots
from services.square import LOG_FILE
from tests.harness.command_line import CommandLine, CommandResult
from tests.harness.cpu_load import cpu_load
from tests.system.short_fleets import reordered_lab, short_lab

ROBOTS = [f"tb3_{number}" for number in range(4)]
DRIVING = ["p3dx", *ROBOTS]
ALL = ["arm", *DRIVING]
RUN_KEYS = {
    *("fleet", "mode", "sim_seconds", "wall_seconds", "real_time_factor", "seed", "version"),
    *("trajectory_hash", "messages_lost", "restarts"),
}
ROBOT_KEYS = {
    *("points", "points_reached", "cross_track_rms_m", "cross_track_max_m", "odometry_error_max_m"),
    *("path_length_m", "min_distance_m", "collisions", "commands_timed_out"),
}


class LabRun:
    """A run of the shortened lab."""

    def __init__(self, ended: CommandResult, results: Path) -> None:
        self.ended, self.results = ended, results
        assert ended.out, ended.err
        self.report: dict[str, Any] = json.loads(ended.out)
        self.run: dict[str, Any] = self.report["run"]

    @property
    def log(self) -> str:
        """The logs of all its processes."""
        return "".join(each.read_text() for each in sorted((self.results / "logs").iterdir()))


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> CommandLine:
    return CommandLine(tmp_path_factory.mktemp("lab"))


@pytest.fixture(scope="module")
def first(terminal: CommandLine) -> LabRun:
    return drive(terminal, "first", short_lab(terminal.folder / "short.toml"))


def drive(
    terminal: CommandLine, name: str, fleet: Path, *options: str, beside: AbstractContextManager[None] | None = None
) -> LabRun:
    results = terminal.folder / name
    with beside or nullcontext():
        return LabRun(terminal.run_fleet(fleet, results, "--json", *options, picture=name == "first"), results)


def test_every_robot_reaches_every_point(first: LabRun) -> None:
    assert first.ended.status == 0, first.ended.err
    assert first.report["ok"] is True
    assert first.run["ended"] == "goals"
    assert first.run["messages_lost"] == first.run["restarts"] == 0
    for name in ROBOTS:
        robot = first.report["robots"][name]
        assert (robot["points"], robot["points_reached"], robot["collisions"]) == (2, 2, 0)
        assert robot["commands_timed_out"] == 0
        assert 0.97 < robot["path_length_m"] < 1.05
        assert robot["cross_track_max_m"] < 0.01
        assert 0.45 < robot["min_distance_m"] <= 0.5
        assert 8 < robot["time_s"] < 15


def test_the_pioneer_drives_its_square_beside_them_and_meets_nobody(first: LabRun) -> None:
    pioneer = first.report["robots"]["p3dx"]
    assert (pioneer["points"], pioneer["points_reached"], pioneer["collisions"]) == (4, 4, 0)
    assert 15 < pioneer["time_s"] <= first.run["sim_seconds"] < 20
    assert pioneer["closure_m"] < 0.005
    assert pioneer["closure_heading_deg"] < 0.5
    assert pioneer["odometry_error_max_m"] < 0.001
    assert pioneer["min_distance_m"] > 1.5


def test_the_arm_does_its_exercise_beside_them(first: LabRun) -> None:
    """With latency it acts on the state of the previous tick, so its rise is steeper than alone."""
    arm = first.report["robots"]["arm"]
    assert arm["step_final_deg"] == pytest.approx(29.63, abs=0.05)
    assert arm["step_overshoot_percent"] < 1.0
    assert arm["tracking_rms_deg"] == pytest.approx(0.19, abs=0.02)
    assert arm["control_gap_s"] == pytest.approx(0.01)
    assert 8 < arm["time_s"] < 10


def test_the_report_is_as_promised(first: LabRun) -> None:
    jsonschema.validate(first.report, json.loads(SCHEMA_FILE.read_text()))
    assert first.report == json.loads((first.results / "report.json").read_text())
    assert first.report["schema"] == 1
    assert first.run.keys() >= RUN_KEYS
    assert list(first.report["robots"]) == ALL
    assert all(first.report["robots"][name].keys() >= ROBOT_KEYS for name in DRIVING)
    assert first.report["checks"]
    assert all(check.keys() >= {"name", "value", "bound", "ok"} for check in first.report["checks"])
    assert (first.run["fleet"], first.run["mode"], first.run["seed"]) == ("lab", "lockstep", 3)
    factor = first.run["sim_seconds"] / first.run["wall_seconds"]
    assert first.run["real_time_factor"] == pytest.approx(factor, rel=0.02)
    assert (first.results / "report.png").stat().st_size > 10_000


def test_neither_load_nor_another_order_changes_anything(terminal: CommandLine, first: LabRun) -> None:
    again = drive(terminal, "reordered", reordered_lab(terminal.folder / "reordered.toml"), beside=cpu_load(2))
    assert again.ended.status == 0, again.ended.err
    same(first, again)


def same(one: LabRun, other: LabRun) -> None:
    """Assert that both runs are identical bit for bit, without lost messages or restarts."""
    assert other.run["messages_lost"] == one.run["messages_lost"] == 0, other.ended.err
    assert other.run["restarts"] == one.run["restarts"] == 0, other.ended.err
    assert other.run["trajectory_hash"] == one.run["trajectory_hash"], other.ended.err + other.log
    assert other.run["sim_seconds"] == one.run["sim_seconds"]
    assert other.report["robots"] == one.report["robots"]
    assert (other.results / LOG_FILE).read_bytes() == (one.results / LOG_FILE).read_bytes()


def test_a_mode_that_is_gone_is_refused_with_what_to_take(terminal: CommandLine) -> None:
    ended = terminal.run("up", "lab", "--mode", "free")
    assert (ended.status, ended.out) == (2, "")
    assert "Use lockstep: it runs as fast as the machine can, and waits for the controllers" in ended.err


def test_its_duration_ends_it_whatever_the_factor_of_the_wall_clock(terminal: CommandLine) -> None:
    lap = drive(terminal, "cut", Path("lab"), "--duration", "2", "--factor", "0.001")
    assert (lap.run["ended"], lap.run["sim_seconds"]) == ("duration", 2.0)
    assert lap.ended.status == 1
    missed = [check["name"] for check in lap.report["checks"] if not check["ok"]]
    exercise = [name for name in missed if name.startswith("arm.")]
    assert {"arm.step_final_deg", "arm.tracking_rms_deg"} <= set(exercise)
    assert [name for name in missed if name not in exercise] == [f"{name}.points_reached" for name in DRIVING]


def test_the_recording_opens_in_the_viewer(first: LabRun, tmp_path: Path) -> None:
    png = tmp_path / "run.png"
    screenshots(first.results / "run.rrd", [Screenshot(png)])
    pixels = np.rint(matplotlib.image.imread(png)[:, :, :3] * 255).astype(int)
    assert pixels.shape == (1080, 1920, 3)
    assert pixels.std() > 5
    for name, colour in colours(ALL).items():
        if name == "arm":
            continue  # it has no trail
        assert (np.abs(pixels - np.array(colour)).max(axis=2) < 25).sum() > 100, f"nothing drawn in {colour}"
