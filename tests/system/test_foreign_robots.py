"""Imported robots, one differential and one skid-steered, drive through points and are graded."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from tests.harness.command_line import CommandLine
from tests.models import robots

FLEET = """
name = "own"

[[robot]]
name = "courier"
model = "courier.urdf"
services = [{ kind = "waypoint", parameters = { goals = [[0.4, 0.0], [0.4, 0.3]] } }]

[[robot]]
name = "ranger"
model = "ranger.urdf"
pose = { y = -1.5 }
services = [{ kind = "waypoint", parameters = { goals = [[0.4, -1.5], [0.4, -1.2]] } }]
"""


def test_two_urdfs_from_outside_reach_their_points(tmp_path: Path) -> None:
    for name in ("courier", "ranger"):
        shutil.copy(Path(robots.__file__).with_name(f"{name}.urdf"), tmp_path)
    fleet, results = tmp_path / "own.toml", tmp_path / "results"
    fleet.write_text(FLEET)
    ended = CommandLine(tmp_path).run_fleet(str(fleet), results, "--no-saved")
    assert ended.status == 0, ended.out + ended.err
    report = json.loads((results / "report.json").read_text())
    assert report["ok"]
    for name in ("courier", "ranger"):
        measured = report["robots"][name]
        assert measured["points_reached"] == 2
        assert measured["odometry_error_max_m"] < 0.01, f"{name}: its wheels count what it drove"
        assert measured["cross_track_max_m"] < 0.01
