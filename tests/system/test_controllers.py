"""A ros_control controller on a user's arm, in a real fleet in lockstep: two runs are identical bit for bit."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from messages.actionlib import Status
from tests.harness.command_line import CommandLine
from tests.harness.joint_rig import URDF
from tests.system import trajectory_client

FLEET = """
name = "controllers"

[run]
mode = "lockstep"
ends = "duration"
duration = 5.5

[[robot]]
name = "arm"
model = "./arm.urdf"
services = [
    { kind = "controller_manager", parameters = { config = "controllers.yaml" } },
    { kind = "./client.py" },
]

[[change]]
at = 3
set = "/arm/arm_controller/gains/elbow"
values = { p = 80.0 }
"""
CONTROLLERS = """
controller_manager:
  ros__parameters:
    update_rate: 200
    arm_controller: {type: joint_trajectory_controller/JointTrajectoryController}
arm_controller:
  ros__parameters:
    joints: [shoulder, elbow]
    command_interfaces: [effort]
    state_interfaces: [position, velocity]
    gains:
      shoulder: {p: 600, i: 900, d: 25, i_clamp: 20}
      elbow: {p: 60, i: 120, d: 1.5, i_clamp: 10}
    constraints: {stopped_velocity_tolerance: 0.05, shoulder: {goal: 0.01}, elbow: {goal: 0.01}}
"""


def run(terminal: CommandLine, name: str) -> dict[str, float]:
    """Run the fleet and return the values of the client's checks."""
    fleet, results = terminal.folder / "fleet.toml", terminal.folder / name
    ended = terminal.run_fleet(fleet, results, "--json", "--no-saved", "--no-picture")
    assert ended.status == 0, ended.err + ended.out
    report: dict[str, Any] = json.loads(ended.out)
    assert report["changes"][0]["made_at_s"] == 3.0
    gains = report["parameters"]["/arm/arm_controller/gains/elbow"]
    assert (gains["p"], gains["d"]) == ({"value": 80.0, "origin": "run"}, {"value": 1.5, "origin": "fleet"})
    prefix = "/arm/client."
    return {each["name"].removeprefix(prefix): each["value"] for each in report["checks"] if prefix in each["name"]}


def test_goals_by_topics_move_an_arm_twice_the_same(tmp_path: Path) -> None:
    terminal = CommandLine(tmp_path)
    (tmp_path / "fleet.toml").write_text(FLEET)
    (tmp_path / "controllers.yaml").write_text(CONTROLLERS)
    shutil.copy(URDF, tmp_path / "arm.urdf")
    shutil.copy(trajectory_client.__file__, tmp_path / "client.py")
    first, second = run(terminal, "first"), run(terminal, "second")
    assert first == second
    states = {name: Status(int(first[f"{name}_state"])) for name in trajectory_client.WAYS}
    done = dict.fromkeys(("first", "second", "third"), Status.SUCCEEDED)
    assert states == {"early": Status.PREEMPTED, **done}
    assert first["digest"] > 0
