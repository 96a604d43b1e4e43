"""A killed sweep resumes where it was, and its runs are identical to those of ``up``."""

from __future__ import annotations

import csv
import json
import signal
from pathlib import Path

from tests.harness.command_line import CommandLine
from tests.harness.waiting import wait_until

FLEET = """\
name = "short"
[run]
ends = "duration"
duration = 2
[[robot]]
name = "tb3_0"
model = "burger"
services = [{ kind = "waypoint", parameters = { goals = [[2, 0]] } }]
"""
SWEEP = ("--seeds", "1", "--set", "/tb3_0/waypoint max_linear=0.1,0.2")


def test_a_killed_sweep_goes_on_and_its_runs_are_those_of_up(tmp_path: Path) -> None:
    terminal = CommandLine(tmp_path)
    fleet, folder = tmp_path / "short.toml", tmp_path / "sweep"
    fleet.write_text(FLEET)
    killed = terminal.start("sweep", str(fleet), *SWEEP, "--report", str(folder))
    first = folder / "runs" / "0000" / "result.json"
    wait_until(first.exists, 60.0, "the first run of the sweep")
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    written = first.stat().st_mtime_ns

    plot = ("--plot", "tb3_0.path_length_m", "--over", "/tb3_0/waypoint max_linear")
    ended = terminal.run("sweep", "--resume", str(folder), "--jobs", "2", *plot)
    assert ended.status == 1, "a robot that is stopped on its way has not reached its point"
    assert first.stat().st_mtime_ns == written, "it is not run again"
    rows = list(csv.DictReader((folder / "sweep.csv").open()))
    assert [(each["/tb3_0/waypoint.max_linear"], each["seed"]) for each in rows] == ([("0.1", "1"), ("0.2", "1")])
    assert float(rows[0]["tb3_0.path_length_m"]) < float(rows[1]["tb3_0.path_length_m"])
    assert (folder / "sweep.parquet").exists()
    assert (folder / "tb3_0.path_length_m.png").exists()

    alone = tmp_path / "alone"
    options = ("--seed", "1", "--set", "/tb3_0/waypoint max_linear=0.2", "--no-saved")
    terminal.run_fleet(fleet, alone, *options)
    report = json.loads((alone / "report.json").read_text())
    assert report["run"]["trajectory_hash"] == rows[1]["trajectory_hash"]
