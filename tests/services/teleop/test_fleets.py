"""The fleet with wrong wheel geometry: it warns, and the report shows the effect."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from deploy.fleet_file import find_fleet, parse_fleet
from tests.harness.command_line import CommandLine

SPEED, AHEAD_S = 0.5, 4.1
"""The script's first key: speed [m/s], and duration [s] including the dead-man time-out."""


def test_wrong_wheel_figures_are_warned_of_and_their_damage_is_measured(tmp_path: Path) -> None:
    ended = CommandLine(tmp_path).run_fleet("teleop_wrong", tmp_path / "run", "--json")
    assert ended.status == 0, ended.err
    report = json.loads(ended.out)
    robot = report["robots"]["p3dx"]
    # It commands 0.5 m/s twice, for 4.1 s and 3.1 s, with equal ramps. The base drives at 0.65 of that.
    commanded = SPEED * (AHEAD_S + 3.1)
    assert robot["path_length_m"] == pytest.approx(0.65 * commanded, rel=0.03)
    assert robot["odometry_error_max_m"] > 0.5
    (log,) = (tmp_path / "run" / "logs").glob("sim*")
    warning = "p3dx: wheel radius 0.15 and separation 0.39 m are configured, the URDF has 0.0975 and 0.33 m"
    assert warning in log.read_text()
    assert report["notes"][0].startswith(warning)
    assert report["notes"][1:] == ["/p3dx/script left lockstep before the end"], "its keys were at an end"


def test_the_fleet_to_drive_has_nobody_who_drives_it() -> None:
    path = find_fleet("teleop")
    fleet = parse_fleet(path, path.read_text())
    assert [(each.name, each.model, each.services) for each in fleet.robot] == [("p3dx", "p3dx", ())]
    assert (fleet.run.mode, fleet.run.ends, fleet.every_robot) == ("real", "never", ())
