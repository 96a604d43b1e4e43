"""Programs of ROS 1 that drive robots by odometry, laser, transforms and time."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.harness.cases import case
from tests.ros1.script_fleets import ScriptRun, assert_began, assert_said, assert_same, run_scripts

SAID = {
    "tf_out_and_back": ["home True facing True"],
    "pose_printer": [
        "frames odom base_footprint, yaw 0",
        "imu True, joints ['wheel_left_joint', 'wheel_right_joint']",
        "0.0 36 tuple",
    ],
    "lights/start_stop": ["changes 6"],
    "square/timed_square": ["square done", "Stop Drawing Squares"],
    "odom_square": ["Square completed!", "sides 4, home within 0.5 m True, logged True"],
    "once/publish_once": ["legs done"],
    "back/out_and_back": ["out and back", "Stopping the robot..."],
    "point/goto_point": ["arrived within True"],
    "wander/turtlebot_scan": ["turned True, kept True"],
    "wander/range_ahead": ["range ahead: 1 of 360", "nearest ahead: 1 tuple"],
    "wall/wall_follower": ["states [0, 1, 2], beside the wall True"],
    "heading/pid_heading": ["tracked True with rows True"],
    "mover/move_client": ["Done!", "moved 40 steps", "took 4 s"],
    "keys/key_script": ["keys sent"],
    "formation": ["1", "2", "3"],
    "patrol/patrol_client": [
        "at 0.6 0.0: state 3",
        "at 0.6 0.5: state 3",
        "moved True",
        "control_msgs/FollowJointTrajectoryAction",
    ],
}
SILENT = ["keys/key_driver", "mover/move_service", "repeat", "patrol/patrol_server"]
DRIVEN_M = {
    "solo": (0.55, 0.75),
    "lights": (1.2, 1.3),
    "square": (0.9, 1.0),
    "RosAria": (1.5, 1.9),
    "once": (0.57, 0.63),
    "back": (0.75, 0.83),
    "point": (0.95, 1.25),
    "wander": (0.5, 2.4),
    "wall": (0.4, 2.8),
    "heading": (0.0, 0.05),
    "mover": (0.55, 0.62),
    "keys": (0.6, 1.4),
    "tb3_0": (1.2, 1.8),
    "tb3_1": (0.9, 1.8),
    "patrol": (0.9, 1.4),
}
"""Paths in m that follow from each program's speeds and times, by ground truth. In real time a machine that lets a
program wait lengthens what it drives by the clock; in lockstep time waits for the program.
"""


FLEETS = ("drive", "tasks")


def assert_drove(run: ScriptRun) -> list[str]:
    """Each program of the fleet came to its end and drove, in lockstep with its figures; all programs of the fleet."""
    here, exact = set(run.processes()), run.report["run"]["mode"] == "lockstep"
    expected = {process: lines for process, lines in SAID.items() if process in here}
    if exact:
        assert_said(run, expected)
    else:
        assert_began(run, expected)
    for robot, found in run.report["robots"].items():
        with case(robot):
            least, most = DRIVEN_M[robot]
            if exact:
                assert least <= found["path_length_m"] <= most
            assert found["path_length_m"] >= least / 2
            assert found["collisions"] == 0
    return [each for each in (*SAID, *SILENT) if each in here]


@pytest.mark.timeout(420)
def test_each_program_drives_its_way_in_real_time(tmp_path: Path) -> None:
    flooded = {"drive": "", "tasks": "tb3_1"}
    runs = [run_scripts(fleet, tmp_path / fleet, "real", "--factor", "2", flooded=flooded[fleet]) for fleet in FLEETS]
    assert {each for run in runs for each in assert_drove(run)} == {*SAID, *SILENT}


@pytest.mark.timeout(420)
def test_in_lockstep_they_drive_the_same_way_twice(tmp_path: Path) -> None:
    for fleet, seconds in {"drive": "15", "tasks": "16"}.items():
        first = run_scripts(fleet, tmp_path / f"{fleet}1", "lockstep", "--duration", seconds)
        second = run_scripts(fleet, tmp_path / f"{fleet}2", "lockstep", "--duration", seconds)
        assert_same(first, second, assert_drove(first))
